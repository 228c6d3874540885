//! The work of a helper, in its own process.

use std::{
    os::unix::process::CommandExt,
    path::{Path, PathBuf},
    process::Command,
};

use gyre_stage::run::end_with;
use rustix::process::Signal;

use crate::{StressError, copying, helper::COMMAND, load};

/// Does the work of a helper: its arguments are the process that has started it, the kind of work, and what that needs.
///
/// # Errors
/// Work that is not known, or a failure of it.
pub fn help(program: &Path, arguments: &[String]) -> Result<(), StressError> {
    let usage = || StressError::Usage(format!("`gyre {COMMAND}` is what `gyre stress` starts"));
    let [parent, work, rest @ ..] = arguments else {
        return Err(usage());
    };
    let signal = match work.as_str() {
        // It ends its stages first.
        "run" => Signal::TERM,
        _ => Signal::KILL,
    };
    let parent = parent.parse().map_err(|_| usage())?;
    let refused = |error: rustix::io::Errno| StressError::Usage(error.to_string());
    if !end_with(parent, signal).map_err(refused)? {
        return Err(StressError::Interrupted);
    }
    match (work.as_str(), rest) {
        ("run", words) => Err(StressError::Start {
            program: program.display().to_string(),
            source: Command::new(program).args(words).exec(),
        }),
        ("spin", []) => load::spin(),
        ("memory", [share]) => load::churn(share.parse().map_err(|_| usage())?),
        ("observe", [out]) => load::observe(&PathBuf::from(out)),
        ("hand-over", words) => copying::helper(words),
        _ => Err(usage()),
    }
}
