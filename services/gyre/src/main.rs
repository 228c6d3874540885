//! `gyre`: radar odometry as cooperating processes, on the command line.

use std::process::ExitCode;

use clap::Parser;
use gyre::cli::Gyre;

fn main() -> ExitCode {
    gyre::report("gyre", gyre::execute(Gyre::parse().command))
}
