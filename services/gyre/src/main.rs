//! `gyre`: radar odometry as cooperating processes, on the command line.

use std::process::ExitCode;

use gyre::cli::Gyre;
use gyre_stage::CountingAllocator;

/// Each run reports the allocations of its stages.
#[global_allocator]
static ALLOCATOR: CountingAllocator = CountingAllocator;

fn main() -> ExitCode {
    match gyre_configuration::terminal::parse_as::<Gyre>(gyre::cli::command(), "gyre") {
        Ok(gyre) => gyre_configuration::terminal::report("gyre", gyre::execute(gyre.command)),
        Err(code) => code,
    }
}
