//! `gyre spoil`: a recording with faults that were put there on purpose.

use std::process::ExitCode;

use gyre_simulator::{FaultPlan, write_faulty};

use crate::{Failure, cli::SpoilArguments, print};

/// Writes the spoilt copy, and says which scans were hit.
pub fn spoil(arguments: &SpoilArguments) -> Result<ExitCode, Failure> {
    let &SpoilArguments {
        fault, every, seed, ..
    } = arguments;
    let hits = write_faulty(
        &arguments.path,
        &arguments.out,
        &FaultPlan { fault, every, seed },
    )?;
    let numbers: Vec<_> = hits.iter().map(usize::to_string).collect();
    print::line(format_args!(
        "wrote {} with {fault} in {} scans: {}",
        arguments.out.display(),
        hits.len(),
        numbers.join(" ")
    ))?;
    Ok(ExitCode::SUCCESS)
}
