//! The laboratory's commands as a whole, with real processes.

#![allow(clippy::unwrap_used)]

#[path = "../../../tests/common/mod.rs"]
mod common;

mod corrupt;
mod export_pairs;
mod tables;

/// The program that is measured: `.ci/research` builds it.
const PROGRAM: &str = match option_env!("GYRE_PROGRAM") {
    Some(program) => program,
    None => concat!(env!("CARGO_MANIFEST_DIR"), "/../../target/debug/gyre"),
};
/// The program under test.
const LAB: &str = env!("CARGO_BIN_EXE_gyre-lab");
/// The project's folder.
const PROJECT: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../..");

/// The program under test.
fn gyre_lab() -> std::process::Command {
    let mut command = std::process::Command::new(LAB);
    command.env("GYRE_PROGRAM", PROGRAM);
    command
}
