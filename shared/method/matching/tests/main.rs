//! The searches and the refinement on generated scenes. One program, so that all of it is linked
//! once.

#![allow(clippy::unwrap_used)]

mod common;
mod odometry;

mod conventions;
mod exhaustive;
mod hostile_input;
mod known_motions;
mod refinement;
mod refinement_doppler;
mod refinement_faults;
mod refinement_gyro;
mod refinement_wheels;
mod slow_sweeps;
mod tunnel;
