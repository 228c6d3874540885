//! The helper's side of [`Work`]: the process that does it.

use std::{os::unix::process::CommandExt, path::Path, process::Command};

use gyre_stage::run::end_with;
use rustix::process::Signal;

use crate::{
    StressError,
    copying::{self, Medium},
    helper::COMMAND,
    load,
    work::Work,
};

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
    // What has shared memory of its own ends by itself, and leaves nothing of it.
    let signal = match &work {
        Work::Run(_) => Signal::TERM,
        Work::Send(plan) if plan.medium == Medium::SharedMemory => Signal::TERM,
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
