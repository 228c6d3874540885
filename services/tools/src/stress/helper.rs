//! Child processes that load the machine or take part in a measurement:
//! `gyre stress-helper PARENT WORK`.
//!
//! A helper ends with the process that has started it, even if that is killed.

use std::{
    io::{BufRead, BufReader},
    os::unix::process::CommandExt,
    path::PathBuf,
    process::{Child, Command, Stdio},
};

use gyre_client::run::end_with;
use gyre_configuration::terminal::{Failure, own};
use rustix::process::Signal;
use serde::{Deserialize, Serialize};

use crate::stress::load;

/// The command of `gyre` that calls [`help`].
pub const COMMAND: &str = "stress-helper";

/// The work of a helper, which it gets as JSON on its command line.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Work {
    /// Becomes `gyre` with these arguments, and ends its stages first.
    Run(Vec<String>),
    Spin,
    /// Takes this share of the available memory, and churns it.
    Memory(f64),
    /// Reads all topics of the run that writes to this folder.
    Observe(PathBuf),
}

pub fn help(arguments: &[String]) -> Result<(), Failure> {
    let usage = || format!("`gyre {COMMAND}` is what `gyre stress` starts");
    let [parent, work] = arguments else {
        return Err(usage().into());
    };
    let parent = parent.parse().map_err(|_| usage())?;
    let work: Work = serde_json::from_str(work).map_err(|_| usage())?;
    // A run has shared memory of its own: it ends itself, and removes that memory.
    let signal = match &work {
        Work::Run(_) => Signal::TERM,
        _ => Signal::KILL,
    };
    if !end_with(parent, signal)? {
        return Err("interrupted".into());
    }
    match work {
        Work::Run(words) => {
            let error = Command::new(own()).args(words).exec();
            Err(format!("cannot start a run: {error}").into())
        }
        Work::Spin => load::spin(),
        Work::Memory(share) => load::churn(share),
        Work::Observe(out) => load::observe(&out),
    }
}

pub fn spawn(work: &Work, output: Stdio, errors: Stdio) -> Result<Child, Failure> {
    let spawned = Command::new(own())
        .arg(COMMAND)
        .arg(std::process::id().to_string())
        .arg(serde_json::to_string(work)?)
        .stdin(Stdio::null())
        .stdout(output)
        .stderr(errors)
        .spawn();
    Ok(spawned.map_err(|error| format!("cannot start a helper process: {error}"))?)
}

/// A helper process. It is killed when this is dropped.
#[derive(Debug)]
pub struct Helper {
    work: Work,
    process: Child,
}

impl Helper {
    /// Starts a helper, and waits until it works.
    pub fn start(work: Work) -> Result<Self, Failure> {
        let mut process = spawn(&work, Stdio::piped(), Stdio::inherit())?;
        let mut line = String::new();
        let output = process.stdout.take().map(BufReader::new);
        let read = output.map(|mut output| output.read_line(&mut line));
        let helper = Self { work, process };
        match read {
            Some(Ok(_)) if line.trim_end() == load::READY => Ok(helper),
            _ => {
                let work = &helper.work;
                Err(
                    format!("the helper process `{work:?}` has ended; its output has the reason")
                        .into(),
                )
            }
        }
    }

    /// Returns a sentence about a helper that has ended although it should still work.
    pub fn has_died(&mut self) -> Option<String> {
        let status = self.process.try_wait().ok().flatten()?;
        Some(format!("`{:?}` has ended: {status}", self.work))
    }
}

impl Drop for Helper {
    fn drop(&mut self) {
        let _ = self.process.kill();
        let _ = self.process.wait();
    }
}
