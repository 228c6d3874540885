//! A run that the new one cannot continue, as after an upgrade: it has its results, and its folder
//! keeps all that it holds under a name with the time of its begin.

use std::{
    fs,
    path::{Path, PathBuf},
    time::{Duration, SystemTime},
};

use gyre_configuration::{
    Configuration,
    terminal::{Failure, print},
};
use gyre_contract::run::{BEGUN_WITH, EarlierRun, Ending, Mode};
use gyre_journal as journal;
use gyre_results::{Identity, Out, SUMMARY, Session, machine::file_time};
use gyre_storage as storage;

use super::{CONFIGURATION, is_complete, make_way};

pub fn is_closed(configuration: &Configuration) -> bool {
    match configuration.run.earlier {
        EarlierRun::Auto => configuration.run.mode == Mode::Live,
        EarlierRun::Refuse => false,
        EarlierRun::Close => true,
    }
}

/// Closes a run; returns the folder of the new one.
pub fn close(out: Out, reason: &Failure) -> Result<Out, Failure> {
    if let Err(error) = write_last_results(&out) {
        print::note(format_args!(
            "gyre: the earlier run keeps the results that it has: {error}"
        ));
    }
    let path = out.path();
    let kept = free_name(path);
    let (old, new) = (kept.display(), path.display());
    storage::rename(path, &kept)
        .map_err(|error| format!("{reason}; it cannot be kept as {old} (run.earlier): {error}"))?;
    storage::sync_folder(path.parent().unwrap_or(path))?;
    let reason = reason.to_string();
    let reason = reason.split(": choose another").next().unwrap_or_default();
    print::note(format_args!(
        "gyre: {reason}: that run is kept as {old}, and a new one begins in {new} (run.earlier)"
    ));
    Ok(Out::lock(path)?)
}

/// Writes the results of a run that was killed, by its own configuration.
fn write_last_results(out: &Out) -> Result<(), Failure> {
    let written = modified(&out.join(SUMMARY));
    let journalled = modified(&journal::path(out.path()));
    if is_complete(out.path()) || journalled.is_none() || written >= journalled {
        return Ok(());
    }
    let configuration = Configuration::read(&out.join(CONFIGURATION), &[])?;
    let session = Session {
        scans: Identity::read(out)?.scans,
        resumed: usize::try_from(journal::check(out.path())?.poses)?,
        damage: None,
        needs_all: false,
        wall: Duration::ZERO,
        footprint: None,
        ending: Some(Ending::Interrupted),
        report: None,
    };
    gyre_results::write(&configuration, out, &session, &|poses| make_way(out, poses))?;
    Ok(())
}

fn modified(path: &Path) -> Option<SystemTime> {
    fs::metadata(path).and_then(|it| it.modified()).ok()
}

/// Returns a name that nothing has: the time of the begin of the run follows the name of its
/// folder, and a number follows that where two runs began at one time.
fn free_name(out: &Path) -> PathBuf {
    let begun = modified(&out.join(BEGUN_WITH)).unwrap_or_else(SystemTime::now);
    let time = file_time(begun);
    let names = (1..).map(|number: u32| {
        let mut name = out.as_os_str().to_owned();
        name.push(format!(".{time}"));
        if number > 1 {
            name.push(format!("-{number}"));
        }
        PathBuf::from(name)
    });
    let mut free = names.filter(|name| !name.exists());
    free.next().unwrap_or_default()
}
