//! The laboratory's commands as a whole, with real processes.

#![allow(clippy::unwrap_used)]

#[path = "../../tests/common/mod.rs"]
mod common;

mod corrupt;
mod export_pairs;
mod tables;

/// The program that is measured, beside the laboratory: `cargo build -p gyre` makes it, as do all
/// tests of the workspace.
const PROGRAM: &str = LAB.split_at(LAB.len() - "-lab".len()).0;
/// The program under test.
const LAB: &str = env!("CARGO_BIN_EXE_gyre-lab");
/// The project's folder.
const PROJECT: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/..");

/// The program under test.
fn gyre_lab() -> std::process::Command {
    std::process::Command::new(LAB)
}
