//! `gyre doctor`: what this machine lacks for a run, each with its remedy.

mod memory;
mod system;

use std::{fmt, path::PathBuf, process::ExitCode};

use clap::Args;
use gyre_messages::Footprint;
use gyre_terminal::{Failure, print};

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
        system::open_files(observers),
        system::processes(),
        system::core_files(),
        memory::results(&arguments.out),
        system::onnx_runtime(),
        system::python(),
    ];
    findings.iter().try_for_each(print::values)?;
    let bad = findings.iter().filter(|found| found.state == State::Bad);
    let (sentence, code) = match bad.count() {
        0 => (
            "a run works here; `gyre demo` tries it".to_owned(),
            ExitCode::SUCCESS,
        ),
        1 => (
            "no run works here while this fails: 1".to_owned(),
            ExitCode::FAILURE,
        ),
        count => (
            format!("no run works here while these fail: {count}"),
            ExitCode::FAILURE,
        ),
    };
    print::line(sentence)?;
    Ok(code)
}

/// A check of the machine.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Finding {
    subject: &'static str,
    state: State,
    /// The finding, a sentence.
    found: String,
    /// The remedy; empty if there is nothing to do.
    remedy: String,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum State {
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
