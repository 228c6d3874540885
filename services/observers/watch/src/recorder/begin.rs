//! Where a recording begins: a new one, or the next part of one that an earlier recorder of the run
//! has begun.

use std::{fs, path::Path};

use gyre_client::{Manifest, RunError, clock};
use gyre_recording::{Head, Ledger, Positions, RecordingError, next_part, parts};

use super::{HEALTH, LOG, Options};

pub(crate) struct Begun {
    pub head: Head,
    pub ledger: Option<Ledger>,
    /// The positions behind the parts of earlier recorders of this run, if there were any.
    pub earlier: Option<Positions>,
}

/// Returns the part to write: the next one where a recorder of this run was there before.
pub(crate) fn begin(
    options: &Options,
    manifest: &Manifest,
    topics: &[String],
) -> Result<Begun, RunError> {
    let ledger = options.continues.then(|| Ledger::of(&manifest.out));
    let earlier = ledger.as_ref().map(|ledger| ledger.read(&options.to));
    let earlier = earlier.transpose().map_err(failed)?.flatten();
    if earlier.is_none() {
        require_new(&options.to)?;
    }
    let part = next_part(&options.to, earlier.as_ref().map_or(0, |it| it.part));
    let id = earlier.as_ref().map(|it| it.id.clone());
    let new_id = || {
        let prefix = manifest.prefix.trim_matches('_');
        format!("{prefix}-{}", clock::since_1970_ns())
    };
    let is_topic = |topic: &&String| *topic != LOG && *topic != HEALTH;
    let file = manifest.root.join("config.toml");
    let configuration =
        fs::read_to_string(&file).map_err(|source| RunError::File { path: file, source })?;
    let head = Head {
        id: id.unwrap_or_else(new_id),
        part,
        configuration,
        topics: topics.iter().filter(is_topic).cloned().collect(),
        scan_bytes: manifest.limits.scan_bytes,
        mode: if manifest.live { "live" } else { "lossless" }.to_owned(),
    };
    Ok(Begun {
        head,
        ledger,
        earlier: earlier.map(|it| it.positions),
    })
}

pub fn require_own(file: &Path, out: &Path) -> Result<(), RunError> {
    match Ledger::of(out).read(file).map_err(failed)? {
        Some(_) => Ok(()),
        None => require_new(file),
    }
}

/// A recording that cannot be written, or an earlier part that cannot be read.
pub(crate) fn failed(error: RecordingError) -> RunError {
    RunError::Input(format!(
        "cannot record: {error}; the run continues without a recording"
    ))
}

/// Checks that a new recording neither overwrites nor continues an existing one, even if only later
/// parts are left.
pub fn require_new(file: &Path) -> Result<(), RunError> {
    let first = parts(file).into_iter().next();
    // Also something else of that name, a folder for instance.
    match first.or(file.exists().then(|| file.to_owned())) {
        Some(there) => Err(RunError::Input(format!(
            "{} exists, and a recording is never overwritten: name another file, or remove it",
            there.display()
        ))),
        None => Ok(()),
    }
}
