//! Child processes that load the machine or take part in a measurement:
//! `gyre stress-helper PARENT WORK`.
//!
//! A helper ends with the process that has started it, even if that is killed.

use std::{
    io::{BufRead, BufReader},
    os::unix::process::CommandExt,
    path::{Path, PathBuf},
    process::{Child, ChildStdout, Command, Stdio},
};

use gyre_stage::run::end_with;
use rustix::process::Signal;
use serde::{Deserialize, Serialize, de::DeserializeOwned};

use crate::stress::{StressError, load};

/// The command of `gyre` that calls [`help`].
pub const COMMAND: &str = "stress-helper";

/// The work of a helper, which it gets as JSON on its command line.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Work {
    /// Becomes `gyre` with these arguments, and ends its stages first.
    Run(Vec<String>),
    /// Computes without end.
    Spin,
    /// Takes this share of the available memory, and churns it.
    Memory(f64),
    /// Reads all topics of the run that writes to this folder.
    Observe(PathBuf),
}

/// Does the work of a helper: its arguments are the process that has started it, and the work.
pub fn help(program: &Path, arguments: &[String]) -> Result<(), StressError> {
    let usage = || StressError::Usage(format!("`gyre {COMMAND}` is what `gyre stress` starts"));
    let [parent, work] = arguments else {
        return Err(usage());
    };
    let parent = parent.parse().map_err(|_| usage())?;
    let work: Work = serde_json::from_str(work).map_err(|_| usage())?;
    // A run has shared memory of its own: it ends itself, and removes that memory.
    let signal = match &work {
        Work::Run(_) => Signal::TERM,
        _ => Signal::KILL,
    };
    let refused = |error: rustix::io::Errno| StressError::Usage(error.to_string());
    if !end_with(parent, signal).map_err(refused)? {
        return Err(StressError::Interrupted);
    }
    match work {
        Work::Run(words) => Err(StressError::Start {
            program: program.display().to_string(),
            source: Command::new(program).args(words).exec(),
        }),
        Work::Spin => load::spin(),
        Work::Memory(share) => load::churn(share),
        Work::Observe(out) => load::observe(&out),
    }
}

/// A helper process. It is killed when this is dropped.
#[derive(Debug)]
pub struct Helper {
    work: Work,
    process: Child,
    output: BufReader<ChildStdout>,
}

impl Helper {
    /// Starts a helper.
    pub fn start(program: &Path, work: Work) -> Result<Self, StressError> {
        let mut command = command(program, &work)?;
        command.stdin(Stdio::null()).stdout(Stdio::piped());
        let started = command.spawn().map_err(|source| StressError::Start {
            program: program.display().to_string(),
            source,
        });
        let mut process = started?;
        let output = process
            .stdout
            .take()
            .ok_or_else(|| failed(&work, "has no output"))?;
        let mut helper = Self {
            output: BufReader::new(output),
            work,
            process,
        };
        helper.await_line(load::READY)?;
        Ok(helper)
    }

    /// Returns a sentence about a helper that has ended although it should still work.
    pub fn has_died(&mut self) -> Option<String> {
        let status = self.process.try_wait().ok().flatten()?;
        Some(format!("`{:?}` has ended: {status}", self.work))
    }

    fn read_line(&mut self) -> Result<String, StressError> {
        let mut line = String::new();
        match self.output.read_line(&mut line) {
            Ok(read) if read > 0 => Ok(line.trim_end().to_owned()),
            _ => Err(self.failed("has ended; what it printed says why")),
        }
    }

    /// Reads a result, a line of JSON.
    pub fn read_result<T: DeserializeOwned>(&mut self) -> Result<T, StressError> {
        let line = self.read_line()?;
        serde_json::from_str(&line).map_err(|error| self.failed(&format!("says `{line}`: {error}")))
    }

    fn await_line(&mut self, expected: &str) -> Result<(), StressError> {
        let line = self.read_line()?;
        match line == expected {
            true => Ok(()),
            false => Err(self.failed(&format!("says `{line}`, not `{expected}`"))),
        }
    }

    fn failed(&self, reason: &str) -> StressError {
        failed(&self.work, reason)
    }
}

fn failed(work: &Work, reason: &str) -> StressError {
    StressError::Helper {
        helper: format!("{work:?}"),
        reason: reason.to_owned(),
    }
}

impl Drop for Helper {
    fn drop(&mut self) {
        let _ = self.process.kill();
        let _ = self.process.wait();
    }
}

/// Returns the command of a helper that is a child of this process.
pub(crate) fn command(program: &Path, work: &Work) -> Result<Command, StressError> {
    let work = json(work)?;
    let mut command = Command::new(program);
    command
        .arg(COMMAND)
        .arg(std::process::id().to_string())
        .arg(work);
    Ok(command)
}

fn json(value: &impl Serialize) -> Result<String, StressError> {
    serde_json::to_string(value).map_err(|error| StressError::Usage(error.to_string()))
}
