//! Simulated drives. One program, so that all of it is linked once.

#![allow(clippy::unwrap_used)]

mod common;

mod dataset;
mod recorded_drives;
mod simulated_drive;
mod sweep;
