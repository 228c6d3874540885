//! The laboratory's commands as a whole, with real processes.

#![allow(clippy::unwrap_used)]

#[path = "../../tests/common/mod.rs"]
mod common;

mod corrupt;
mod export_pairs;
mod realism;
mod tables;

/// The program under test.
const PROGRAM: &str = env!("CARGO_BIN_EXE_gyre-lab");
/// The project's folder.
const PROJECT: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/..");
