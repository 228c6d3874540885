//! The folder of a map, which is replaced as a whole.

use std::{
    fs, io,
    path::{Path, PathBuf},
};

use gyre_configuration::terminal::Failure;
use gyre_results::{Content, Out, OutError};
use gyre_slam::{
    Keyframe, Record,
    localisation::Map,
    mapping::{Evidence, Origin, require_tiles_only, write_map},
};
use gyre_storage::{self as storage, StorageError};

/// The next map while it is written, in the folder of the map.
const NEXT: &str = ".next";
/// The earlier map while the next one takes its place.
const EARLIER: &str = ".earlier";
/// Without it a folder is not a map. It is written last, and changes its place last.
const MANIFEST: &str = "map.toml";
/// Without the first nothing can be localised in the folder: they go first and come last.
const MARKS: [&str; 2] = [Keyframe::FILE, MANIFEST];

/// Makes a map ready to be read: if the command that drew it was killed when the map was about to
/// take its place, it takes it now.
pub fn settle(map: &Path) -> Result<(), Failure> {
    if !is_interrupted(map) {
        return Ok(());
    }
    let locked = match Out::lock_for(map, Content::MAP) {
        Err(held @ OutError::Held(_)) => return Err(held.into()),
        locked => locked.map_err(Failure::from),
    };
    let finished = locked.and_then(|_locked| Ok(finish(map)?));
    finished.map_err(|error| {
        format!(
            "the map {} was left half replaced by a command that was killed, and cannot be put right ({error}): let its owner read it once, with gyre localise, or draw it again",
            map.display()
        )
        .into()
    })
}

/// Writes a map and its keyframes into `out`. A map that is there stays as it is until the new one
/// is complete, and takes as much of the disk until then; pictures and exports stay. It survives a
/// power failure when this returns.
pub fn write(
    out: &Path,
    keyframes: &Map,
    evidence: &mut Evidence,
    origin: Option<Origin>,
) -> Result<(), Failure> {
    require_tiles_only(out)?;
    finish(out)?;
    replace(out, |next| {
        keyframes.save(next)?;
        let made_by = concat!("gyre ", env!("CARGO_PKG_VERSION"));
        Ok(write_map(next, evidence, origin, made_by)?)
    })
}

/// Lets `write` fill a folder, whose files and folders then replace the entries of the same names
/// in `out`. A process that is killed between these renames leaves what [`finish`] needs.
fn replace(out: &Path, write: impl FnOnce(&Path) -> Result<(), Failure>) -> Result<(), Failure> {
    let next = out.join(NEXT);
    storage::create_folder(&next)?;
    if let Err(error) = write(&next) {
        remove(&next)?;
        return Err(error);
    }
    storage::sync_folder(&next)?;
    Ok(finish(out)?)
}

/// Returns whether a process was killed when a whole map was about to take its place.
fn is_interrupted(out: &Path) -> bool {
    out.join(NEXT).join(MANIFEST).exists()
}

/// Finishes an exchange that a kill interrupted: the next map, if it is whole, takes its place, and
/// all else is removed.
fn finish(out: &Path) -> Result<(), StorageError> {
    let [next, earlier] = [NEXT, EARLIER].map(|name| out.join(name));
    if is_interrupted(out) {
        storage::create_folder(&earlier)?;
        swap(out, &next, &earlier)?;
    }
    remove(&next)?;
    remove(&earlier)
}

/// Moves what `next` has to `out`, and what `out` has of the same names to `earlier`. If it is
/// killed, it may be called again: what `next` still has is not in `out` yet.
fn swap(out: &Path, next: &Path, earlier: &Path) -> Result<(), StorageError> {
    let names = names(next)?;
    for name in names.iter().rev().filter(|name| out.join(name).exists()) {
        rename(&out.join(name), &earlier.join(name))?;
    }
    storage::sync_folder(out)?;
    for name in &names {
        rename(&next.join(name), &out.join(name))?;
    }
    storage::sync_folder(out)
}

/// Returns the names in a folder, the marks last.
fn names(folder: &Path) -> Result<Vec<PathBuf>, StorageError> {
    let entries = fs::read_dir(folder).and_then(|entries| {
        let name = |entry: io::Result<fs::DirEntry>| Ok(entry?.file_name().into());
        entries.map(name).collect::<io::Result<Vec<PathBuf>>>()
    });
    let mut names = entries.map_err(StorageError::at("read", folder))?;
    names.sort_by_key(|name| MARKS.iter().position(|mark| name == Path::new(mark)));
    Ok(names)
}

fn rename(from: &Path, to: &Path) -> Result<(), StorageError> {
    fs::rename(from, to).map_err(StorageError::at("write", to))
}

fn remove(folder: &Path) -> Result<(), StorageError> {
    match fs::remove_dir_all(folder) {
        Err(error) if error.kind() == io::ErrorKind::NotFound => Ok(()),
        removed => removed.map_err(StorageError::at("remove", folder)),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const FILES: [&str; 3] = ["tiles/0_0.png", "keyframes.log", "map.toml"];

    fn content(folder: &Path, name: &str) -> String {
        fs::read_to_string(folder.join(name)).unwrap()
    }

    fn write_all(folder: &Path, text: &str) {
        fs::create_dir_all(folder.join("tiles")).unwrap();
        FILES
            .iter()
            .for_each(|name| fs::write(folder.join(name), text).unwrap());
    }

    /// Asserts that a folder has one map, which is of this text, and this many entries.
    fn has(folder: &Path, text: &str, entries: usize) {
        assert_eq!(FILES.map(|name| content(folder, name)), [text; 3]);
        assert_eq!(names(folder).unwrap().len(), entries);
    }

    #[test]
    fn an_earlier_map_stays_whole_until_the_next_one_is_complete() {
        let folder = tempfile::tempdir().unwrap();
        let out = folder.path();
        write_all(out, "earlier");
        fs::write(out.join("map.png"), "a picture").unwrap();
        let failed = replace(out, |next| {
            fs::write(next.join("keyframes.log"), "half of").unwrap();
            Err("a full disk".into())
        });
        failed.unwrap_err();
        has(out, "earlier", 4);
        fs::create_dir(out.join(NEXT)).unwrap();
        fs::write(out.join(NEXT).join("keyframes.log"), "of a killed one").unwrap();
        finish(out).unwrap();
        replace(out, |next| {
            assert_eq!(names(next).unwrap(), [] as [PathBuf; 0]);
            write_all(next, "later");
            Ok(())
        })
        .unwrap();
        has(out, "later", 4);
        assert_eq!(content(out, "map.png"), "a picture");
    }

    #[test]
    fn a_map_that_was_left_half_replaced_is_finished_by_who_reads_it_or_said_to_be() {
        let folder = tempfile::tempdir().unwrap();
        let map = folder.path();
        write_all(&map.join(NEXT), "later");
        let writing = Out::lock_for(map, Content::MAP).unwrap();
        let refused = settle(map).unwrap_err().to_string();
        assert!(refused.starts_with("another command is writing"));
        drop(writing);
        settle(map).unwrap();
        assert_eq!(content(map, "map.toml"), "later");
        // Something of that name that is no folder stands for what this user may not write.
        write_all(&map.join(NEXT), "even later");
        fs::write(map.join(EARLIER), "").unwrap();
        let refused = settle(map).unwrap_err().to_string();
        assert!(refused.contains("was left half replaced"), "{refused}");
        assert_eq!(content(map, "map.toml"), "later");
    }

    /// All states of the folder after a kill between two renames.
    #[test]
    fn an_exchange_that_was_interrupted_anywhere_is_finished() {
        for renames in 0..=6 {
            let folder = tempfile::tempdir().unwrap();
            let [out, next, earlier] = ["", NEXT, EARLIER].map(|name| folder.path().join(name));
            write_all(&out, "earlier");
            fs::write(out.join("map.png"), "a picture").unwrap();
            write_all(&next, "later");
            fs::create_dir(&earlier).unwrap();
            let names = names(&next).unwrap();
            assert_eq!(names[1..], MARKS.map(PathBuf::from));
            let away = names.iter().rev().map(|name| (&out, &earlier, name));
            let back = names.iter().map(|name| (&next, &out, name));
            for (from, to, name) in away.chain(back).take(renames) {
                rename(&from.join(name), &to.join(name)).unwrap();
            }
            assert_eq!(is_interrupted(&out), renames < 6, "{renames}");
            finish(&out).unwrap();
            has(&out, "later", 4);
            assert_eq!(content(&out, "map.png"), "a picture");
        }
    }
}
