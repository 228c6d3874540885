//! Simulated drives. One program, so that all of it is linked once.

#![allow(clippy::unwrap_used)]

mod common;

mod dataset;
mod effects;
mod method;
mod simulated_drive;
mod streets_along;
mod sweep;
mod town;
