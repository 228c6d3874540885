//! `gyre`: radar odometry as cooperating processes, on the command line.

use std::process::ExitCode;

use clap::Parser;
use gyre::cli::Gyre;
use gyre_stage::CountingAllocator;

/// Each run reports the allocations of its stages.
#[global_allocator]
static ALLOCATOR: CountingAllocator = CountingAllocator;

fn main() -> ExitCode {
    gyre::report("gyre", gyre::execute(Gyre::parse().command))
}
