//! Simulated drives. One program, so that all of it is linked once.

#![allow(clippy::unwrap_used)]

mod dataset;
mod simulated_drive;
mod sweep;

use std::{collections::BTreeMap, fs, path::Path};

/// The content of all files in a folder and its subfolders, by relative path.
fn all_files(folder: &Path) -> BTreeMap<String, Vec<u8>> {
    let mut files = BTreeMap::new();
    for entry in fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        let name = path.file_name().unwrap().to_string_lossy().into_owned();
        if path.is_dir() {
            files.extend(
                all_files(&path)
                    .into_iter()
                    .map(|(below, bytes)| (format!("{name}/{below}"), bytes)),
            );
        } else {
            files.insert(name, fs::read(&path).unwrap());
        }
    }
    files
}
