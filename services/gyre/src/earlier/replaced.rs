//! A complete run that another run replaces. Its results stay until the results of the new run are
//! in place, and its journal lies aside until then. If the new run fails before its first motion,
//! all files are restored.

use std::{ffi::OsStr, fs, path::Path};

use gyre_configuration::terminal::{Failure, print};
use gyre_contract::{flag, run::COMPLETE};
use gyre_journal as journal;
use gyre_results::{Out, REPLACED as ASIDE, SIMULATED_TRUTH};
use gyre_storage::{self as storage, LogError, StorageError};

use super::{CONFIGURATION, is_complete, state};

const JOURNAL: &str = "journal";
/// Files that the new run overwrites before it has results.
const BESIDE: [&str; 2] = [CONFIGURATION, SIMULATED_TRUTH];
/// The least number of poses for a motion, and so for results.
pub(super) const WITH_MOTION: usize = 2;

/// Returns whether the results in the folder belong to a complete run that is being replaced.
pub(super) fn is_kept(out: &Out) -> bool {
    out.join(ASIDE).exists()
}

pub(super) fn put_aside(out: &Out) -> Result<(), StorageError> {
    let aside = out.join(ASIDE);
    if !is_complete(out.path()) || !storage::rename(&out.join(JOURNAL), &aside)? {
        return Ok(());
    }
    storage::sync_folder(out.path())?;
    for name in BESIDE {
        storage::rename(&out.join(name), &aside.join(name))?;
    }
    storage::sync_folder(&aside)?;
    storage::sync_folder(out.path())
}

/// Finishes an interrupted replacement: the complete run is removed if the new run has its results,
/// and restored if the new run has computed nothing.
pub fn settle(out: &Out) -> Result<(), Failure> {
    match (is_whole(out), is_untouched(out)?) {
        (false, _) => Ok(remove(out)?),
        (true, true) => Ok(give_back(out)?),
        (true, false) => Ok(()),
    }
}

/// Returns whether the folder has all files of a complete run that was about to be replaced.
fn is_whole(out: &Out) -> bool {
    !is_complete(out.path()) && out.join(ASIDE).join(mark()).exists()
}

/// Returns whether the run that is to replace a complete one has computed nothing: that is given
/// back.
pub fn is_untouched(out: &Out) -> Result<bool, Failure> {
    if !is_whole(out) {
        return Ok(false);
    }
    let records = match journal::poses(out.path()) {
        // Another version has begun there, or what was computed is damaged.
        Err(LogError::OtherVersion { .. } | LogError::Damaged { .. }) => return Ok(false),
        records => records?,
    };
    let poses = records.filter(|record| {
        let is_end = record.as_ref().is_ok_and(|pose| pose.item.is(flag::END));
        !is_end
    });
    Ok(poses.take(WITH_MOTION).count() < WITH_MOTION)
}

/// Makes sure that a complete run is never given back: its results are about to be replaced.
pub(super) fn invalidate(out: &Out) -> Result<(), StorageError> {
    let aside = out.join(ASIDE);
    match is_kept(out) {
        true => drop_mark(&aside),
        false => Ok(()),
    }
}

pub(super) fn remove(out: &Out) -> Result<(), StorageError> {
    match is_kept(out) {
        true => empty(&out.join(ASIDE), &out.join(JOURNAL)),
        false => Ok(()),
    }
}

/// Gives a complete run back, whose results are still in place, and removes the new one.
pub(super) fn give_back(out: &Out) -> Result<(), StorageError> {
    let (journal, aside) = (out.join(JOURNAL), out.join(ASIDE));
    for name in BESIDE {
        storage::rename(&aside.join(name), &out.join(name))?;
    }
    storage::sync_folder(out.path())?;
    if journal.exists() {
        empty(&journal, &aside)?;
    }
    storage::rename(&aside, &journal)?;
    storage::sync_folder(out.path())?;
    print::note(format_args!(
        "gyre: {} has the results of the complete run before, because the new run had none",
        out.path().display()
    ));
    Ok(())
}

fn mark() -> &'static OsStr {
    Path::new(COMPLETE).file_name().unwrap_or_default()
}

/// Removes the mark of a complete run: without it nothing is given back.
fn drop_mark(folder: &Path) -> Result<(), StorageError> {
    storage::remove(&folder.join(mark()))?;
    storage::sync_folder(folder)
}

/// Removes a folder and the files of a run in it. The files of others go to `others`.
fn empty(folder: &Path, others: &Path) -> Result<(), StorageError> {
    drop_mark(folder)?;
    let of_run: Vec<_> = state(Path::new(""))
        .into_iter()
        .filter_map(|path| Some(path.file_name()?.to_owned()))
        .chain(BESIDE.map(Into::into))
        .collect();
    let listed = fs::read_dir(folder).map_err(StorageError::at("read", folder))?;
    for entry in listed {
        let path = entry.map_err(StorageError::at("read", folder))?.path();
        let name = path.file_name().unwrap_or_default();
        let is_of_run = of_run.iter().any(|own| own == name) || storage::is_draft(&path);
        match is_of_run || others.join(name).exists() {
            true => storage::remove(&path)?,
            false => drop(storage::rename(&path, &others.join(name))?),
        }
    }
    fs::remove_dir(folder).map_err(StorageError::at("remove", folder))
}

#[cfg(test)]
mod tests {
    use std::ops::Range;

    use gyre_contract::{Item, PoseHeader};
    use gyre_journal::Journal;
    use tempfile::TempDir;

    use super::{super::make_way, *};

    fn compute(out: &Out, poses: Range<u64>) {
        let mut journal = Journal::open(out.path()).unwrap();
        for seq in poses {
            let pose = PoseHeader {
                item: Item::numbered(seq),
                ..PoseHeader::default()
            };
            journal.append(&pose).unwrap();
        }
    }

    /// The folder of a complete run whose journal is put aside.
    fn being_replaced() -> (TempDir, Out) {
        let folder = tempfile::tempdir().unwrap();
        let out = Out::lock(folder.path()).unwrap();
        compute(&out, 0..3);
        storage::write(&out.join(COMPLETE), "poses = 3\n").unwrap();
        assert!(!is_untouched(&out).unwrap());
        put_aside(&out).unwrap();
        (folder, out)
    }

    #[test]
    fn a_complete_run_is_untouched_until_the_new_one_has_a_motion() {
        let (_folder, out) = being_replaced();
        assert!(is_untouched(&out).unwrap());
        compute(&out, 0..1);
        assert!(is_untouched(&out).unwrap());
        compute(&out, 1..2);
        assert!(!is_untouched(&out).unwrap());
        settle(&out).unwrap();
        assert!(is_kept(&out) && !is_complete(out.path()));
    }

    #[test]
    fn a_complete_run_is_not_given_back_where_another_version_has_begun() {
        let (_folder, out) = being_replaced();
        compute(&out, 0..1);
        let path = journal::path(out.path());
        let mut bytes = fs::read(&path).unwrap();
        bytes[..16].copy_from_slice(b"gyre journal v9 ");
        fs::write(&path, bytes).unwrap();
        assert!(!is_untouched(&out).unwrap());
        settle(&out).unwrap();
        assert!(is_kept(&out));
    }

    #[test]
    fn a_complete_run_is_not_given_back_beside_the_results_of_another_one() {
        let (_folder, out) = being_replaced();
        compute(&out, 0..3);
        assert!(make_way(&out, 3).unwrap());
        // It is killed there, and so is a third one when it has begun.
        storage::remove(&journal::path(out.path())).unwrap();
        settle(&out).unwrap();
        assert!(!is_kept(&out) && !is_complete(out.path()));
    }
}
