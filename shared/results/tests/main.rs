//! Metrics and their drawings. One program, so that all of it is linked once.

#![allow(clippy::unwrap_used)]

mod common;

mod consistency;
mod golden;
mod plots;
mod properties;
