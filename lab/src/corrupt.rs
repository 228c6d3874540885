//! `gyre-lab corrupt`: a recording with faults that were put there on purpose.

mod faults;
#[cfg(test)]
mod tests;

use std::process::ExitCode;

use gyre::{Failure, print};

use crate::cli::CorruptArguments;

pub use faults::Fault;
use faults::{FaultPlan, write_faulty};

/// Writes the spoilt copy, and says which scans were hit.
pub fn corrupt(arguments: &CorruptArguments) -> Result<ExitCode, Failure> {
    let &CorruptArguments {
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
