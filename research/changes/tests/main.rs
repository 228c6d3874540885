//! Changes on a street whose content is known, and the whole program.

#![allow(clippy::unwrap_used)]

#[path = "../../../tests/common/mod.rs"]
mod common;

mod drives;
mod street;

/// The program that writes runs: `.ci/research` builds it.
const PROGRAM: &str = match option_env!("GYRE_PROGRAM") {
    Some(program) => program,
    None => concat!(env!("CARGO_MANIFEST_DIR"), "/../../target/debug/gyre"),
};
/// The project's folder.
const PROJECT: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../..");

/// The program under test.
fn gyre_changes() -> std::process::Command {
    std::process::Command::new(env!("CARGO_BIN_EXE_gyre-changes"))
}
