//! The logs of a run: the output of each stage, and the events of all.

use std::{
    fs::{self, File, OpenOptions},
    io::{self, PipeReader, PipeWriter, Seek, SeekFrom, Write},
    mem,
    os::unix::fs::OpenOptionsExt,
    path::{Path, PathBuf},
    sync::{Arc, Mutex, MutexGuard, PoisonError},
    thread,
};

use gyre_client::last_line;
use gyre_transport::{Manifest, RunError};
use rustix::{
    event::{PollFd, PollFlags, poll},
    io::{Errno, ioctl_fionbio},
};

/// Size of a log beyond which it is moved to its `.old`, bytes.
const MAX: u64 = 8 << 20;

/// The log of a supervisor that runs in the background, by its name in the folder of the logs.
const BACKGROUND: &str = "gyre";

/// The longest last line that is looked for, bytes.
const TAIL: usize = 4096;

/// The most bytes taken from a pipe at once: its capacity.
const BUFFER: usize = 1 << 16;
/// Times in a row that so much is taken.
const ROUNDS: usize = 64;
/// The stack of a thread that writes a log, bytes.
const STACK: usize = 1 << 18;

/// The log `<out>/log/<stage>.txt`. The output of the stage comes through a pipe, so that the file
/// is bounded before anything is written that is too much: a stage that floods waits.
pub(crate) struct Log {
    output: PipeWriter,
    collected: Arc<Mutex<Collected>>,
}

struct Collected {
    input: PipeReader,
    file: File,
    path: PathBuf,
    /// The end of the output since the last look.
    tail: Vec<u8>,
    buffer: Box<[u8]>,
}

impl Log {
    pub fn open(manifest: &Manifest, stage: &str) -> Result<Self, RunError> {
        let path = path_of(manifest, stage);
        Self::at(&path).map_err(|source| RunError::File { path, source })
    }

    fn at(path: &Path) -> io::Result<Self> {
        let file = OpenOptions::new()
            .create(true)
            .read(true)
            .append(true)
            .mode(0o600)
            .open(path)?;
        let (input, output) = io::pipe()?;
        // A reader takes the present output, and does not wait with the lock.
        ioctl_fionbio(&input, true)?;
        let readable = input.try_clone()?;
        let collected = Arc::new(Mutex::new(Collected {
            input,
            file,
            path: path.to_owned(),
            tail: Vec::new(),
            buffer: vec![0; BUFFER].into(),
        }));
        let collecting = Arc::clone(&collected);
        let thread = thread::Builder::new().name("log".to_owned());
        thread
            .stack_size(STACK)
            .spawn(move || collect(&readable, &collecting))?;
        Ok(Self { output, collected })
    }

    pub fn output(&self) -> &PipeWriter {
        &self.output
    }

    /// Returns the last line since the last call, as far as its end is.
    pub fn last_line(&mut self) -> Option<String> {
        let collected = &mut *lock(&self.collected);
        collected.take();
        let tail = mem::take(&mut collected.tail);
        last_line(&String::from_utf8_lossy(&tail)).map(str::to_owned)
    }
}

impl Drop for Log {
    /// Writes the remaining output of an ended stage.
    fn drop(&mut self) {
        lock(&self.collected).take();
    }
}

/// Writes the data from a pipe, until all its writers have ended.
fn collect(readable: &PipeReader, collected: &Mutex<Collected>) {
    loop {
        let mut readable = [PollFd::new(readable, PollFlags::IN)];
        match poll(&mut readable, None) {
            Ok(_) | Err(Errno::INTR) => {}
            Err(_) => return,
        }
        if !lock(collected).take() {
            return;
        }
    }
}

fn lock(collected: &Mutex<Collected>) -> MutexGuard<'_, Collected> {
    collected.lock().unwrap_or_else(PoisonError::into_inner)
}

impl Collected {
    /// A stage that floods is left for others to look at after a while.
    fn take(&mut self) -> bool {
        for _ in 0..ROUNDS {
            match rustix::io::read(&self.input, &mut self.buffer[..]) {
                Ok(0) => return false,
                Ok(bytes) => self.write(bytes),
                Err(Errno::AGAIN) => return true,
                Err(Errno::INTR) => {}
                Err(_) => return false,
            }
        }
        true
    }

    fn write(&mut self, bytes: usize) {
        let bytes = &self.buffer[..bytes];
        // On a full disk it is lost but for its end.
        let _ = self.file.write_all(bytes);
        bound(&self.file, &self.path);
        let newest = &bytes[bytes.len().saturating_sub(TAIL)..];
        self.tail.extend_from_slice(newest);
        let old = self.tail.len().saturating_sub(TAIL);
        self.tail.drain(..old);
    }
}

/// Keeps the logs of a run short where processes append directly.
pub(crate) fn bound_all(manifest: &Manifest) {
    for path in [manifest.events(), path_of(manifest, BACKGROUND)] {
        if fs::symlink_metadata(&path).is_ok_and(|log| log.is_file())
            && let Ok(log) = OpenOptions::new().read(true).write(true).open(&path)
        {
            bound(&log, &path);
        }
    }
}

fn path_of(manifest: &Manifest, stage: &str) -> PathBuf {
    manifest.out.join("log").join(format!("{stage}.txt"))
}

/// The processes that append to it do not notice.
fn bound(log: &File, path: &Path) {
    if length(log) > MAX {
        // On a full disk the end is lost: the space is needed more.
        let _ = copy_end(log, path);
        let _ = log.set_len(0);
    }
}

fn copy_end(mut log: &File, path: &Path) -> io::Result<()> {
    log.seek(SeekFrom::Start(length(log).saturating_sub(MAX)))?;
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
    use super::*;

    fn log(folder: &tempfile::TempDir) -> (Log, PathBuf) {
        let path = folder.path().join("stage.txt");
        (Log::at(&path).unwrap(), path)
    }

    #[test]
    fn the_last_line_is_of_what_was_written_since() {
        let folder = tempfile::tempdir().unwrap();
        let (mut log, path) = log(&folder);
        log.output().write_all(b"first\nsecond\n\n").unwrap();
        assert_eq!(log.last_line().as_deref(), Some("second"));
        assert_eq!(log.last_line(), None);
        log.output().write_all(b"third").unwrap();
        assert_eq!(log.last_line().as_deref(), Some("third"));
        log.output().write_all(b" and last").unwrap();
        drop(log);
        let written = fs::read_to_string(path).unwrap();
        assert_eq!(written, "first\nsecond\n\nthird and last");
    }

    #[test]
    fn a_flood_is_bounded_whoever_looks_and_its_end_is_kept() {
        let folder = tempfile::tempdir().unwrap();
        let (mut log, path) = log(&folder);
        let flooding = log.output().try_clone().unwrap();
        let flood = thread::spawn(move || {
            let mut flooding = flooding;
            let line = [b'x'; 1023];
            for _ in 0..10 * MAX / 1024 {
                flooding.write_all(&line).unwrap();
                flooding.write_all(b"\n").unwrap();
            }
            flooding.write_all(b"the end\n").unwrap();
        });
        let size = || fs::metadata(&path).unwrap().len();
        while !flood.is_finished() {
            assert!(size() <= MAX + BUFFER as u64, "{}", size());
        }
        flood.join().unwrap();
        assert_eq!(log.last_line().as_deref(), Some("the end"));
        let old = fs::read(path.with_extension("txt.old")).unwrap();
        let all = [old, fs::read(&path).unwrap()].concat();
        assert!(all.ends_with(b"x\nthe end\n"));
    }

    #[test]
    fn a_log_that_is_removed_is_bounded() {
        let folder = tempfile::tempdir().unwrap();
        let (mut log, path) = log(&folder);
        let file = File::open(&path).unwrap();
        fs::remove_file(&path).unwrap();
        for _ in 0..3 * MAX / TAIL as u64 {
            log.output().write_all(&[b'x'; TAIL]).unwrap();
        }
        log.output().write_all(b"\nthe end\n").unwrap();
        assert_eq!(log.last_line().as_deref(), Some("the end"));
        assert!(length(&file) <= MAX, "{}", length(&file));
    }
}
