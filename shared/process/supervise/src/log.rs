//! The logs of a run: the output of each stage, and the events of all.

use std::{
    fs::{self, File, OpenOptions},
    io::{self, Seek, SeekFrom},
    os::unix::fs::{FileExt, OpenOptionsExt},
    path::{Path, PathBuf},
    time::{Duration, Instant},
};

use gyre_stage::{Manifest, StageError};

use crate::Plan;

/// Size of a log beyond which it is moved to its `.old`, bytes.
const MAX: u64 = 8 << 20;
/// Time between two looks at the sizes.
const PERIOD: Duration = Duration::from_secs(1);

/// The log of a supervisor that runs in the background, by its name in the folder of the logs.
const BACKGROUND: &str = "gyre";

/// The longest last line that is looked for, bytes.
const TAIL: u64 = 4096;

/// The log `<out>/log/<stage>.txt`, to which the stage appends.
pub(crate) struct Log {
    file: File,
    /// The beginning of what has not been looked at.
    unread: u64,
}

impl Log {
    pub fn open(manifest: &Manifest, stage: &str) -> Result<Self, StageError> {
        let path = path_of(manifest, stage);
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
        // The log may have been moved away.
        let unread = if self.unread > end { 0 } else { self.unread };
        let begin = unread.max(end.saturating_sub(TAIL));
        self.unread = end;
        let mut bytes = vec![0; end.saturating_sub(begin) as usize];
        self.file.read_exact_at(&mut bytes, begin).ok()?;
        let text = String::from_utf8_lossy(&bytes);
        last_line(&text).map(str::to_owned)
    }
}

/// Returns the last line that is not empty: what a program that has ended says of it.
pub fn last_line(text: &str) -> Option<&str> {
    text.lines().rfind(|line| !line.trim().is_empty())
}

/// All logs of a run, which are kept short.
pub(crate) struct Logs {
    files: Vec<PathBuf>,
    due: Instant,
}

impl Logs {
    pub fn of(plan: &Plan) -> Self {
        let stages = plan.stages.iter();
        let outputs = stages.map(|stage| path_of(&plan.manifest, &stage.name));
        let others = [plan.manifest.events(), path_of(&plan.manifest, BACKGROUND)];
        Self {
            files: outputs.chain(others).collect(),
            due: Instant::now(),
        }
    }

    /// Bounds all logs, if it is time to look.
    pub fn bound_if_due(&mut self) {
        let now = Instant::now();
        if now >= self.due {
            self.due = now + PERIOD;
            self.bound();
        }
    }

    /// Bounds all logs.
    pub fn bound(&self) {
        self.files.iter().for_each(|file| bound(file));
    }
}

/// Returns the log of a process.
pub(crate) fn path_of(manifest: &Manifest, stage: &str) -> PathBuf {
    manifest.out.join("log").join(format!("{stage}.txt"))
}

/// Moves the end of a log that is too long to its `.old`, and empties it. The processes that append
/// to it do not notice.
pub(crate) fn bound(path: &Path) {
    let too_long = fs::symlink_metadata(path).is_ok_and(|log| log.is_file() && log.len() > MAX);
    if !too_long {
        return;
    }
    // On a full disk the end is lost: the space is needed more.
    let _ = copy_end(path);
    let _ = OpenOptions::new()
        .write(true)
        .open(path)
        .and_then(|log| log.set_len(0));
}

fn copy_end(path: &Path) -> io::Result<()> {
    let mut log = File::open(path)?;
    log.seek(SeekFrom::Start(length(&log).saturating_sub(MAX)))?;
    let mut name = path.as_os_str().to_owned();
    name.push(".old");
    let mut old = OpenOptions::new()
        .create(true)
        .truncate(true)
        .write(true)
        .mode(0o600)
        .open(name)?;
    io::copy(&mut io::Read::take(log, MAX), &mut old)?;
    Ok(())
}

fn length(file: &File) -> u64 {
    file.metadata().map_or(0, |file| file.len())
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use std::io::Write;

    use super::*;

    #[test]
    fn a_log_that_is_too_long_keeps_its_end() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("stage.txt");
        let mut log = OpenOptions::new()
            .create(true)
            .append(true)
            .open(&path)
            .unwrap();
        log.write_all(&vec![b'x'; 3 * MAX as usize]).unwrap();
        log.write_all(b"the end").unwrap();
        bound(&path);
        log.write_all(b"and on").unwrap();
        assert_eq!(fs::read(&path).unwrap(), b"and on");
        let old = fs::read(folder.path().join("stage.txt.old")).unwrap();
        assert_eq!(old.len() as u64, MAX);
        assert!(old.ends_with(b"the end"));
        bound(&path);
        assert_eq!(fs::read(&path).unwrap(), b"and on");
    }

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
