//! Gyre as a whole, with real processes. One program, so that all of it is linked once; each run
//! has a folder of its own.

#![allow(clippy::unwrap_used)]

mod common;

mod input;
mod live;
mod method;
mod observers;
mod operate;
mod reach;
mod restart;
mod slam;

/// The program under test.
const PROGRAM: &str = env!("CARGO_BIN_EXE_gyre");
/// The project's folder.
const PROJECT: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../..");
