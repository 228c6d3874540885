//! `gyre doctor`: what this machine lacks for a run, each with its remedy.

mod memory;
mod system;

use std::{fmt, process::ExitCode};

use crate::{
    Failure, cli::DoctorArguments, configuration::Configuration, preflight, preflight::Preflight,
    print,
};

/// A check of the machine.
#[derive(Clone, Debug, PartialEq, Eq)]
struct Finding {
    subject: &'static str,
    state: State,
    /// The finding.
    found: String,
    /// The remedy; empty if there is nothing to do.
    remedy: String,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum State {
    Good,
    /// A run works, but more slowly, or without a part of it.
    Limited,
    /// A run cannot work.
    Bad,
}

impl Finding {
    fn good(subject: &'static str, found: impl Into<String>) -> Self {
        Self {
            subject,
            state: State::Good,
            found: found.into(),
            remedy: String::new(),
        }
    }

    fn limited(self, remedy: impl Into<String>) -> Self {
        Self {
            state: State::Limited,
            remedy: remedy.into(),
            ..self
        }
    }

    fn bad(self, remedy: impl Into<String>) -> Self {
        Self {
            state: State::Bad,
            remedy: remedy.into(),
            ..self
        }
    }
}

impl fmt::Display for Finding {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let state = match self.state {
            State::Good => "ok",
            State::Limited => "note",
            State::Bad => "FAILS",
        };
        write!(f, "{state:<6}{:<15}{}", self.subject, self.found)?;
        if !self.remedy.is_empty() {
            write!(f, "\n{:21}-> {}", "", self.remedy)?;
        }
        Ok(())
    }
}

/// Prints what was found, and fails if a run cannot work here.
///
/// # Errors
/// The output cannot be written.
pub fn doctor(arguments: &DoctorArguments) -> Result<ExitCode, Failure> {
    let Preflight {
        footprint, window, ..
    } = preflight::check(&simulated()?)?;
    let findings = [
        system::kernel(),
        system::processors(),
        system::vector_units(),
        system::governor(),
        system::clock(),
        memory::main_memory(&footprint),
        memory::shared_memory(&footprint),
        memory::place_in_shared_memory(),
        system::open_files(window.observers),
        system::processes(),
        system::core_files(),
        memory::results(&arguments.out),
        system::onnx_runtime(),
    ];
    findings.iter().try_for_each(print::line)?;
    let bad = findings.iter().filter(|found| found.state == State::Bad);
    match bad.count() {
        0 => {
            print::line("a run works here; `gyre run configs/demo.toml` tries it")?;
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

/// A run of the default configuration, whose scans are as large as those of Oxford.
fn simulated() -> Result<Configuration, Failure> {
    Ok(Configuration::of_overrides(&[
        "simulation.scans=2".to_owned()
    ])?)
}
