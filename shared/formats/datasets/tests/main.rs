//! Readers of scans and trajectories. One program, so that all of it is linked once.

#![allow(clippy::unwrap_used)]

mod common;

mod gnss_logs;
mod gyro_logs;
mod inspect;
mod real_scans;
mod trajectories;
mod written_scans;
