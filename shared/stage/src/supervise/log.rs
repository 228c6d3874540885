//! The log of a stage's standard output and error.

use std::{
    fs::{File, OpenOptions},
    os::unix::fs::{FileExt, OpenOptionsExt},
};

use crate::{Manifest, StageError};

/// The longest last line that is looked for, bytes.
const TAIL: u64 = 4096;

/// The log `<out>/log/<stage>.txt`, to which the stage appends.
pub(super) struct Log {
    file: File,
    /// The beginning of what has not been looked at.
    unread: u64,
}

impl Log {
    pub fn open(manifest: &Manifest, stage: &str) -> Result<Self, StageError> {
        let path = manifest.out.join("log").join(format!("{stage}.txt"));
        let opened = OpenOptions::new()
            .create(true)
            .append(true)
            .read(true)
            .mode(0o600)
            .open(&path);
        let file = opened.map_err(|source| StageError::File { path, source })?;
        let unread = length(&file);
        Ok(Self { file, unread })
    }

    /// Returns the file to which the stage writes.
    pub fn file(&self) -> &File {
        &self.file
    }

    /// Returns the last line since the last call, as far as its end is.
    pub fn last_line(&mut self) -> Option<String> {
        let end = length(&self.file);
        let begin = self.unread.max(end.saturating_sub(TAIL));
        self.unread = end;
        let mut bytes = vec![0; end.saturating_sub(begin) as usize];
        self.file.read_exact_at(&mut bytes, begin).ok()?;
        let text = String::from_utf8_lossy(&bytes);
        let mut lines = text.lines().rev();
        lines
            .find(|line| !line.trim().is_empty())
            .map(str::to_owned)
    }
}

fn length(file: &File) -> u64 {
    file.metadata().map_or(0, |file| file.len())
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use std::io::Write;

    use super::*;

    fn log() -> Log {
        Log {
            file: tempfile::tempfile().unwrap(),
            unread: 0,
        }
    }

    #[test]
    fn the_last_line_is_of_what_was_written_since() {
        let mut log = log();
        log.file().write_all(b"first\nsecond\n\n").unwrap();
        assert_eq!(log.last_line().as_deref(), Some("second"));
        assert_eq!(log.last_line(), None);
        log.file().write_all(b"third").unwrap();
        assert_eq!(log.last_line().as_deref(), Some("third"));
    }

    #[test]
    fn only_the_end_of_a_long_log_is_read_whatever_its_bytes() {
        let mut log = log();
        log.file().write_all(&vec![0xff; 1 << 20]).unwrap();
        log.file().write_all(b"\nthe end\n").unwrap();
        assert_eq!(log.last_line().as_deref(), Some("the end"));
        log.file().write_all(&vec![0xff; 1 << 20]).unwrap();
        let line = log.last_line().unwrap();
        assert_eq!(line.chars().count() as u64, TAIL);
    }
}
