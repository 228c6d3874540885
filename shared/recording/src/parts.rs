//! The files of a recording: FILE.mcap, and FILE.2.mcap, FILE.3.mcap and so on, which recorders that were restarted have begun.

use std::path::{Path, PathBuf};

/// Returns the path of a part, from 1.
fn part(path: &Path, number: usize) -> PathBuf {
    match number {
        1 => path.to_owned(),
        _ => path.with_extension(format!("{number}.mcap")),
    }
}

/// Returns the files of a recording that exist, in order.
pub fn parts(path: &Path) -> Vec<PathBuf> {
    let paths = (1..).map(|number| part(path, number));
    paths.take_while(|path| path.exists()).collect()
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
        std::fs::write(&path, "").unwrap();
        let second = folder.path().join("a.b.2.mcap");
        assert_eq!(next_part(&path), (second.clone(), 2));
        std::fs::write(&second, "").unwrap();
        assert_eq!(parts(&path), [path.clone(), second]);
        assert_eq!(next_part(&path).1, 3);
    }
}
