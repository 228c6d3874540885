//! Readers of scans and trajectories. One program, so that all of it is linked once.

#![allow(clippy::unwrap_used)]

mod common;

mod inspect;
mod real_scans;
mod sample_logs;
mod trajectories;
mod written_scans;
