//! `gyre doctor`: what this machine lacks for a run, each with its remedy.

mod finding;
mod memory;
mod system;

use std::{path::PathBuf, process::ExitCode};

use clap::Args;
use gyre_messages::Footprint;
use gyre_terminal::{Failure, print};

use finding::State;

/// The arguments of `gyre doctor`.
#[derive(Debug, Args)]
pub struct DoctorArguments {
    /// The folder of the results of the run to come.
    #[arg(long, default_value = "out")]
    pub out: PathBuf,
}

/// Prints the findings, and fails if a run cannot work here.
pub fn doctor(
    arguments: &DoctorArguments,
    footprint: &Footprint,
    observers: usize,
) -> Result<ExitCode, Failure> {
    let findings = [
        system::kernel(),
        system::processors(),
        system::vector_units(),
        system::governor(),
        system::clock(),
        memory::main_memory(footprint),
        memory::shared_memory(footprint),
        memory::place_in_shared_memory(),
        system::open_files(observers),
        system::processes(),
        system::core_files(),
        memory::results(&arguments.out),
        system::onnx_runtime(),
        system::python(),
    ];
    findings.iter().try_for_each(print::values)?;
    let bad = findings.iter().filter(|found| found.state == State::Bad);
    match bad.count() {
        0 => {
            print::line("a run works here; `gyre demo` tries it")?;
            Ok(ExitCode::SUCCESS)
        }
        count => {
            let they = if count == 1 {
                "this fails"
            } else {
                "these fail"
            };
            print::line(format_args!("no run works here while {they}: {count}"))?;
            Ok(ExitCode::FAILURE)
        }
    }
}
