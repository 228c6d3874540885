//! The files of a bag.

use std::{
    fs,
    io::Read,
    path::{Component, Path, PathBuf},
};

use gyre_storage::quoted;
use mcap::{MAGIC, records::Record};
use serde::Deserialize;

use crate::{
    RecordingError,
    file::{next, parse},
};

pub(crate) const METADATA: &str = "metadata.yaml";
/// The key that a bag's description begins with.
const INFORMATION: &str = "rosbag2_bagfile_information";
pub(crate) const PROFILE: &str = "ros2";
/// The largest description that is read, bytes.
const MAX_METADATA_BYTES: u64 = 16 << 20;
/// The longest first record of a file, bytes: names of the profile and of a library.
const MAX_HEADER_BYTES: u64 = 4096;

/// Returns whether a path names a bag, of whatever storage: a file of the MCAP profile `ros2`, an
/// SQLite database, or a folder with a bag's description or such files.
pub fn is_bag(path: &Path) -> bool {
    if path.is_dir() {
        return has_metadata(path) || listed(path).iter().any(|file| is_bag_file(file));
    }
    is_bag_file(path)
}

fn is_bag_file(path: &Path) -> bool {
    let name = path.file_name().unwrap_or_default().to_string_lossy();
    match extension(path) {
        "db3" => true,
        "mcap" => profile(path).is_some_and(|profile| profile == PROFILE),
        "zstd" => name.ends_with(".mcap.zstd") || name.ends_with(".db3.zstd"),
        _ => false,
    }
}

fn extension(path: &Path) -> &str {
    path.extension().and_then(|e| e.to_str()).unwrap_or("")
}

fn has_metadata(folder: &Path) -> bool {
    let text = gyre_storage::read_text(&folder.join(METADATA), MAX_METADATA_BYTES);
    text.is_ok_and(|text| text.contains(INFORMATION))
}

/// Returns the profile of an MCAP file; `None` of any other.
fn profile(path: &Path) -> Option<String> {
    let mut head = Vec::new();
    let file = gyre_storage::open(path).ok()?;
    file.take(MAX_HEADER_BYTES).read_to_end(&mut head).ok()?;
    let (opcode, body) = next(&mut head.strip_prefix(MAGIC)?)?;
    match parse(opcode, body) {
        Ok(Record::Header(header)) => Some(header.profile),
        _ => None,
    }
}

#[derive(Deserialize)]
struct Metadata {
    rosbag2_bagfile_information: Information,
}

#[derive(Deserialize)]
struct Information {
    storage_identifier: String,
    relative_file_paths: Vec<PathBuf>,
    #[serde(default)]
    compression_mode: String,
}

#[derive(Debug)]
pub(crate) struct Files {
    pub paths: Vec<PathBuf>,
    /// As a description lists them, or as they were found before.
    pub are_in_order: bool,
}

pub(crate) fn files(path: &Path) -> Result<Files, RecordingError> {
    let is_described = path.is_dir() && has_metadata(path);
    let paths = match path.is_dir() {
        true if is_described => described(path)?,
        true => listed(path),
        false => vec![path.to_owned()],
    };
    for file in &paths {
        match extension(file) {
            "zstd" => return Err(compressed(file)),
            "db3" => return Err(database(file)),
            _ => {}
        }
    }
    if paths.is_empty() {
        let reason = "lists no files: there is nothing to read";
        return Err(RecordingError::unreadable(path, reason));
    }
    Ok(Files {
        are_in_order: is_described || paths.len() == 1,
        paths,
    })
}

fn described(folder: &Path) -> Result<Vec<PathBuf>, RecordingError> {
    let path = folder.join(METADATA);
    let text = gyre_storage::read_text(&path, MAX_METADATA_BYTES)
        .map_err(|error| RecordingError::io(&path, error))?;
    let unreadable = |reason: String| Err(RecordingError::unreadable(folder, reason));
    let metadata: Result<Metadata, _> = serde_saphyr::from_str(&text);
    let information = match metadata {
        Ok(metadata) => metadata.rosbag2_bagfile_information,
        Err(error) => {
            let reason = error.to_string();
            let reason = reason.lines().next().unwrap_or_default();
            return unreadable(format!(
                "has a {METADATA} that cannot be read ({reason}): `ros2 bag reindex` writes it anew"
            ));
        }
    };
    match information.storage_identifier.as_str() {
        "mcap" => {}
        "sqlite3" => return Err(database(folder)),
        other => {
            let storage = quoted(other);
            return unreadable(format!(
                "is stored as {storage}: `ros2 bag convert` with `storage_id: mcap` makes one that is read"
            ));
        }
    }
    let compression = information.compression_mode.to_lowercase();
    if !matches!(compression.as_str(), "" | "none") {
        return Err(compressed(folder));
    }
    let files = information.relative_file_paths.into_iter();
    files.map(|file| within(folder, &file)).collect()
}

/// Returns a file that the description of a bag names, which is in its folder.
fn within(folder: &Path, file: &Path) -> Result<PathBuf, RecordingError> {
    let mut parts = file.components();
    let is_within = parts.all(|part| matches!(part, Component::Normal(_) | Component::CurDir));
    // Bags of the first versions name the folder too.
    let candidates = [is_within.then_some(file), file.file_name().map(Path::new)];
    let mut candidates = candidates.iter().flatten().map(|file| folder.join(file));
    candidates.find(|file| file.is_file()).ok_or_else(|| {
        let reason = format!("lacks its file {}: copy the whole folder", file.display());
        RecordingError::unreadable(folder, reason)
    })
}

/// Returns the files of a folder that has no description, by name.
fn listed(folder: &Path) -> Vec<PathBuf> {
    let entries = fs::read_dir(folder).into_iter().flatten().flatten();
    let paths = entries.map(|entry| entry.path());
    let mut files: Vec<PathBuf> = paths.filter(|path| is_bag_file(path)).collect();
    files.sort();
    files
}

pub(crate) fn compressed(path: &Path) -> RecordingError {
    RecordingError::unreadable(
        path,
        "is compressed as a whole or by messages: `ros2 bag convert` with `compression_mode: none` makes one that is read (MCAP's own \
         compression of chunks is)",
    )
}

fn database(path: &Path) -> RecordingError {
    RecordingError::unreadable(
        path,
        "is stored as an SQLite database: `ros2 bag convert` with `storage_id: mcap` makes one that is read",
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    fn folder(metadata: &str, files: &[&str]) -> tempfile::TempDir {
        let folder = tempfile::tempdir().unwrap();
        fs::write(folder.path().join(METADATA), metadata).unwrap();
        for file in files {
            fs::write(folder.path().join(file), []).unwrap();
        }
        folder
    }

    fn metadata(storage: &str, files: &str, compression: &str) -> String {
        format!(
            "{INFORMATION}:\n  version: 5\n  storage_identifier: {storage}\n  relative_file_paths:\n{files}  \
             compression_mode: \"{compression}\"\n"
        )
    }

    #[test]
    fn the_files_of_a_bag_are_those_of_its_description_in_order() {
        let text = metadata("mcap", "    - b_9.mcap\n    - old/b_10.mcap\n", "");
        let bag = folder(&text, &["b_10.mcap", "b_9.mcap", "c.mcap"]);
        assert!(is_bag(bag.path()));
        let names = files(bag.path()).unwrap().paths;
        assert_eq!(
            names,
            ["b_9.mcap", "b_10.mcap"].map(|name| bag.path().join(name))
        );
    }

    #[test]
    fn bags_of_other_storage_say_how_they_are_converted() {
        let one = "    - a.db3\n";
        for (text, expected) in [
            (metadata("sqlite3", one, ""), "SQLite"),
            (metadata("other", one, ""), "`storage_id: mcap`"),
            (metadata("mcap", one, "FILE"), "`compression_mode: none`"),
            (metadata("mcap", "    - ../a.mcap\n", ""), "lacks its file"),
            (metadata("mcap", "    []\n", ""), "lists no files"),
            (format!("{INFORMATION}: 3\n"), "ros2 bag reindex"),
        ] {
            let bag = folder(&text, &[]);
            let refused = files(bag.path()).unwrap_err().to_string();
            assert!(refused.contains(expected), "{refused}");
            assert_eq!(refused.lines().count(), 1, "{refused}");
        }
    }

    #[test]
    fn other_folders_and_files_are_no_bags() {
        let other = folder("name: 3\n", &["a.mcap", "b.png"]);
        assert!(!is_bag(other.path()) && !is_bag(&other.path().join("a.mcap")));
        assert!(!is_bag(Path::new("/nonexistent.mcap")));
    }
}
