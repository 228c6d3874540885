//! The work of a helper, which it gets as JSON on its command line.

use std::{
    os::unix::process::CommandExt,
    path::{Path, PathBuf},
    process::Command,
};

use gyre_stage::run::end_with;
use rustix::process::Signal;
use serde::{Deserialize, Serialize};

use crate::{
    StressError,
    copying::{self, HandOver},
    helper::COMMAND,
    load,
};

/// The work of a helper.
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
    /// Sends the messages of a hand-over.
    Send(HandOver),
    /// Reads them.
    Read(HandOver),
}

/// Does the work of a helper: its arguments are the process that has started it, and the work.
///
/// # Errors
/// Work that is not known, or a failure of it.
pub fn help(program: &Path, arguments: &[String]) -> Result<(), StressError> {
    let usage = || StressError::Usage(format!("`gyre {COMMAND}` is what `gyre stress` starts"));
    let [parent, work] = arguments else {
        return Err(usage());
    };
    let parent = parent.parse().map_err(|_| usage())?;
    let work: Work = serde_json::from_str(work).map_err(|_| usage())?;
    let signal = match work {
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
        Work::Send(plan) => copying::send(&plan),
        Work::Read(plan) => copying::read(&plan),
    }
}
