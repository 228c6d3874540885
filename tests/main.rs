//! Gyre as a whole, with real processes. One program, so that all of it is linked once; each run has a folder of its own.

#![allow(clippy::unwrap_used)]

mod common;

#[cfg(not(feature = "full"))]
mod absent_features;
mod bad_input;
mod bags;
mod batch;
mod breaks;
mod calibrate;
mod conformance;
mod doctor;
mod evaluate;
mod extended_maps;
mod followers;
mod foreign_stages;
mod foxglove;
mod full_disk;
mod hostile;
mod identity;
mod in_process;
mod joint_search;
mod k2pi;
mod keyframes;
mod learned_masks;
#[cfg(feature = "link")]
mod link;
mod live;
mod localise;
mod lost_input;
mod masks;
mod observers;
mod operate;
mod package;
mod page;
mod pipeline;
mod python_stage;
mod radar;
mod radar_faults;
mod real_scans;
mod record;
mod refinement;
mod resources;
mod restart;
mod results;
#[cfg(feature = "ros2")]
mod ros2;
#[cfg(feature = "ros2")]
mod ros2_driver;
#[cfg(feature = "ros2")]
mod ros2_map;
mod scheduling;
mod shadow;
mod shared_memory;
mod simulation;
mod slam;
mod slurm;
mod standstill;
mod stress;
mod supervisor;
mod swap;
mod systemd;
mod traces;

/// The program under test.
const PROGRAM: &str = env!("CARGO_BIN_EXE_gyre");
/// The project's folder.
const PROJECT: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../..");
