//! The files of a recording: FILE.mcap, and FILE.2.mcap, FILE.3.mcap and so on, which are begun
//! when the one before is large or long enough, and by recorders that were restarted.

use std::{
    fs,
    path::{Path, PathBuf},
};

/// Returns the path of a part, from 1.
fn part(path: &Path, number: usize) -> PathBuf {
    match number {
        1 => path.to_owned(),
        _ => path.with_extension(format!("{number}.mcap")),
    }
}

/// Returns the files of a recording that exist, in order. It is named by its first file, or by a
/// folder that holds it and no other one.
pub fn parts(path: &Path) -> Vec<PathBuf> {
    if path.is_dir() {
        return first_part_in(path).map_or_else(Vec::new, |first| parts(&first));
    }
    let paths = (1..).map(|number| part(path, number));
    paths.take_while(|path| path.exists()).collect()
}

/// Returns the first file of the only recording in a folder.
pub(crate) fn first_part_in(folder: &Path) -> Option<PathBuf> {
    let files = fs::read_dir(folder).ok()?.flatten();
    let files = files.map(|file| file.path()).filter(|path| {
        let is_recording = path.extension().is_some_and(|it| it == "mcap");
        is_recording && !is_hidden(path) && !is_later_part(path)
    });
    let mut first: Vec<PathBuf> = files.take(2).collect();
    first.pop().filter(|_| first.is_empty())
}

/// macOS stores `._NAME.mcap` beside NAME.mcap on file systems of others.
fn is_hidden(path: &Path) -> bool {
    let name = path.file_name().unwrap_or_default();
    name.as_encoded_bytes().starts_with(b".")
}

/// Returns whether a file is NAME.N.mcap beside NAME.mcap.
fn is_later_part(path: &Path) -> bool {
    let name = path.with_extension("");
    let number = name
        .extension()
        .and_then(|it| it.to_str()?.parse::<usize>().ok());
    number.is_some_and(|number| number > 1) && name.with_extension("mcap").exists()
}

/// Returns the path and the number of the part that does not exist yet.
pub fn next_part(path: &Path) -> (PathBuf, usize) {
    let number = parts(path).len() + 1;
    (part(path, number), number)
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    #[test]
    fn a_recording_goes_on_in_the_first_part_that_does_not_exist() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.b.mcap");
        assert_eq!(next_part(&path), (path.clone(), 1));
        fs::write(&path, "").unwrap();
        let second = folder.path().join("a.b.2.mcap");
        assert_eq!(next_part(&path), (second.clone(), 2));
        fs::write(&second, "").unwrap();
        assert_eq!(parts(&path), [path.clone(), second]);
        assert_eq!(next_part(&path).1, 3);
        fs::write(folder.path().join("._a.b.mcap"), "Mac OS X").unwrap();
        assert_eq!(parts(folder.path()), parts(&path), "a folder of one");
        fs::write(folder.path().join("b.mcap"), "").unwrap();
        assert!(parts(folder.path()).is_empty(), "a folder of two");
    }
}
