//! The place of a run in shared memory, `/dev/shm/gyre-<uid>`, which is the user's alone. Beside
//! the root of each run lies its lock, which its supervisor holds as long as the run lives. So a
//! lock that is free belongs to a dead run, and whoever holds it may remove that run.

use std::{
    collections::BTreeSet,
    fs::{self, DirBuilder, File, Metadata, Permissions},
    io,
    os::{
        fd::{AsFd, AsRawFd, OwnedFd},
        unix::fs::{DirBuilderExt, MetadataExt, PermissionsExt},
    },
    path::{Path, PathBuf},
    time::{Duration, Instant},
};

use gyre_storage::lock::{Attempt, try_lock, try_lock_existing};
use rustix::{
    fs::{Mode, OFlags},
    io::Errno,
    process::geteuid,
};

use crate::{RunError, clock, shared_memory::SHARED_MEMORY, wake::Signals};

const OWNER_ONLY: u32 = 0o700;
/// Modes of a directory where others could have put something, or of a special directory.
const NOT_OWN: u32 = 0o7022;
const DIGITS: usize = 10;
/// Time for which a lock is tried. Another supervisor holds the lock of a dead run for some
/// milliseconds, while it removes it.
const LIMIT: Duration = Duration::from_secs(1);
const PAUSE: Duration = Duration::from_millis(20);

/// The root of a run in shared memory, locked by its supervisor. Dropping it removes all files of
/// the run.
#[derive(Debug)]
pub struct RunRoot {
    prefix: String,
    path: PathBuf,
    _lock: File,
}

impl RunRoot {
    /// Creates and locks the root of the run that writes to `out`, after removing the files of the
    /// user's dead runs.
    pub fn acquire(out: &Path, signals: &Signals) -> Result<Self, RunError> {
        let name = name(out);
        let deadline = Instant::now() + LIMIT;
        loop {
            match Self::try_acquire(out, &name) {
                Err(RunError::Transient(_)) if Instant::now() <= deadline => {}
                acquired => return acquired,
            }
            if signals.sleep(PAUSE)? {
                return Err(RunError::Stopped);
            }
        }
    }

    fn try_acquire(out: &Path, name: &str) -> Result<Self, RunError> {
        let runs = user_directory()?;
        roots_in(&runs).for_each(|root| remove_if_dead(&root));
        let path = runs.join(name);
        match try_lock(&lock_of(&path)).map_err(unusable(&path))? {
            Attempt::Locked(lock) => {
                remove_files(&path);
                make_directory(&path).map_err(unusable(&path))?;
                Ok(Self {
                    // Of this start alone: a process that still has files of an earlier run open,
                    // as an observer may, must not remove files of this one.
                    prefix: format!("{name}_{:08x}_", clock::now_ns() as u32),
                    path,
                    _lock: lock,
                })
            }
            Attempt::Held(holder) => {
                let holder = holder.map_or(String::new(), |holder| format!(", {holder}"));
                Err(RunError::Transient(format!(
                    "another run is writing to {}{holder}: wait for it, or choose another --out",
                    out.display()
                )))
            }
        }
    }

    pub fn prefix(&self) -> String {
        self.prefix.clone()
    }

    pub fn path(&self) -> &Path {
        &self.path
    }
}

impl Drop for RunRoot {
    fn drop(&mut self) {
        remove(&self.path);
    }
}

/// Returns the root of this user's run that writes to `out`, an absolute path, whether there is one
/// or not.
pub fn root_of(out: &Path) -> PathBuf {
    user_path().join(name(out))
}

/// Returns the name of the run that writes to `out`. It differs between users, since names in
/// `/dev/shm` are common to all.
fn name(out: &Path) -> String {
    let user = geteuid().as_raw().to_le_bytes();
    let hash = hash(out.as_os_str().as_encoded_bytes().iter().chain(&user));
    format!("gyre{:0DIGITS$x}", hash & 0xff_ffff_ffff)
}

fn user_path() -> PathBuf {
    Path::new(SHARED_MEMORY).join(format!("gyre-{}", geteuid().as_raw()))
}

fn is_root(root: &Path) -> bool {
    let name = root.file_name().and_then(|name| name.to_str());
    let digits = name.and_then(|name| name.strip_prefix("gyre"));
    let digits = digits.unwrap_or_default();
    let is_digit = |byte: u8| byte.is_ascii_digit() || (b'a'..=b'f').contains(&byte);
    digits.len() == DIGITS && digits.bytes().all(is_digit)
}

/// Returns the lock of a run, beside its root: the root is removed while the lock is held.
fn lock_of(root: &Path) -> PathBuf {
    root.with_extension("lock")
}

/// Returns the directory of the user's runs, and creates it if it is missing. `/dev/shm` is open to
/// all users, so an entry there is used only if it is a directory of this user that no other can
/// write to.
fn user_directory() -> Result<PathBuf, RunError> {
    let path = user_path();
    make_directory(&path).map_err(unusable(&path))?;
    make_owner_only(&path)?;
    Ok(path)
}

/// The error of a directory for shared memory. Another attempt may help where the last run of the
/// user has ended, and has removed the user's directory.
fn unusable(path: &Path) -> impl Fn(io::Error) -> RunError {
    move |error| {
        let sentence = format!(
            "cannot use {} for the run's shared memory: {error}; Gyre needs a writable tmpfs at /dev/shm",
            path.display()
        );
        match error.kind() {
            io::ErrorKind::NotFound => RunError::Transient(sentence),
            _ => RunError::Input(sentence),
        }
    }
}

/// Opens a directory without following a link. It need not be readable.
fn open_directory(path: &Path) -> Result<OwnedFd, Errno> {
    let flags = OFlags::PATH | OFlags::DIRECTORY | OFlags::NOFOLLOW | OFlags::CLOEXEC;
    rustix::fs::open(path, flags, Mode::empty())
}

/// Sets the mode of the directory that is open, whatever its name is by now.
fn set_owner_only(directory: &impl AsFd) -> io::Result<()> {
    // A descriptor of this kind has no other way to its mode.
    let path = format!("/proc/self/fd/{}", directory.as_fd().as_raw_fd());
    fs::set_permissions(path, Permissions::from_mode(OWNER_ONLY))
}

/// Checks that a path is a directory of this user that no other could write to, and closes it to
/// all others. A process with another umask may have created it, as the transport does in a process
/// whose run has been removed.
fn make_owner_only(path: &Path) -> Result<(), RunError> {
    let unsafe_ = |state: &str, remedy: &str| {
        let path = path.display();
        RunError::Input(format!(
            "{path} {state}, so the shared memory of a run would not be safe in it: {remedy}"
        ))
    };
    let directory = match open_directory(path) {
        Ok(directory) => directory,
        Err(Errno::NOTDIR | Errno::LOOP) => {
            return Err(unsafe_(
                "is not a directory",
                "remove it, or ask its owner to",
            ));
        }
        Err(error) => return Err(unusable(path)(error.into())),
    };
    let status = rustix::fs::fstat(&directory).map_err(|error| unusable(path)(error.into()))?;
    let (owner, mode) = (status.st_uid, status.st_mode & 0o7777);
    match (owner == geteuid().as_raw(), mode) {
        (true, OWNER_ONLY) => Ok(()),
        (true, mode) if mode & NOT_OWN == 0 => set_owner_only(&directory).map_err(unusable(path)),
        (true, _) => Err(unsafe_(
            &format!("has mode {mode:04o} instead of 0700"),
            &format!("remove it, or `chmod 700 {}`", path.display()),
        )),
        (false, _) => Err(unsafe_(
            &format!("belongs to user {owner}"),
            "ask that user or the administrator to remove it",
        )),
    }
}

/// Creates a directory that is the owner's alone, unless there is one. The mode does not depend on
/// the umask, which the transport changes now and then in a process of several threads.
fn make_directory(path: &Path) -> io::Result<()> {
    match DirBuilder::new().mode(OWNER_ONLY).create(path) {
        Err(error) if error.kind() == io::ErrorKind::AlreadyExists => Ok(()),
        Err(error) => Err(error),
        Ok(()) => set_owner_only(&open_directory(path)?),
    }
}

/// Removes what dead runs of this user left in shared memory. [`RunRoot::acquire`] does this too.
pub fn sweep() {
    roots().iter().for_each(|root| remove_if_dead(root));
}

/// Removes the remains of the run with this root in shared memory, if its supervisor is dead and no
/// other run has its place.
pub fn sweep_run(root: &Path) {
    if root.parent() == Some(&*user_path()) && is_root(root) {
        remove_if_dead(root);
    }
}

/// Returns whether the supervisor of a run lives: it holds the lock.
pub fn is_alive(root: &Path) -> bool {
    matches!(try_lock_existing(&lock_of(root)), Ok(Attempt::Held(_)))
}

/// Returns the roots of this user's runs, dead ones too.
pub fn roots() -> Vec<PathBuf> {
    let runs = user_path();
    match make_owner_only(&runs) {
        Ok(()) => roots_in(&runs).collect(),
        Err(_) => Vec::new(),
    }
}

/// Returns the roots of the runs in a directory: a run has a root or a lock or both.
fn roots_in(runs: &Path) -> impl Iterator<Item = PathBuf> + use<> {
    let entries = fs::read_dir(runs).into_iter().flatten().flatten();
    let roots: BTreeSet<PathBuf> = entries
        .map(|entry| entry.path().with_extension(""))
        .filter(|root| is_root(root))
        .collect();
    roots.into_iter()
}

/// Removes a run whose supervisor was killed: its lock is free.
fn remove_if_dead(root: &Path) {
    // A run that has just ended has removed its lock last. Created again, that would stay if this
    // process were killed here.
    let lock = match try_lock_existing(&lock_of(root)) {
        Err(error) if error.kind() == io::ErrorKind::NotFound && root.exists() => {
            try_lock(&lock_of(root))
        }
        lock => lock,
    };
    if let Ok(Attempt::Locked(_lock)) = lock {
        remove(root);
    }
}

fn remove(root: &Path) {
    remove_files(root);
    // Last: with it the name is free.
    let _ = fs::remove_file(lock_of(root));
    // Fails while the user has another run.
    let _ = root.parent().map(fs::remove_dir);
}

fn remove_files(root: &Path) {
    let name = root.file_name().unwrap_or_default().to_string_lossy();
    for (path, _) in own_files(Path::new(SHARED_MEMORY), &format!("{name}_")) {
        let _ = fs::remove_file(path);
    }
    // An empty directory is removed without a descriptor, since there may be no descriptor left.
    let _ = fs::remove_dir(root).or_else(|_| fs::remove_dir_all(root));
}

pub fn own_files(directory: &Path, prefix: &str) -> impl Iterator<Item = (PathBuf, Metadata)> {
    let user = geteuid().as_raw();
    let entries = fs::read_dir(directory).into_iter().flatten().flatten();
    entries
        .filter(move |entry| entry.file_name().to_string_lossy().starts_with(prefix))
        .filter_map(|entry| Some((entry.path(), entry.metadata().ok()?)))
        .filter(move |(_, file)| file.is_file() && file.uid() == user)
}

/// Closes the files of a run to other users. The transport opens one of them, the counter of its
/// nodes, to all.
pub fn close_to_others(prefix: &str) -> io::Result<()> {
    own_files(Path::new(SHARED_MEMORY), prefix)
        .filter(|(_, file)| file.mode() & 0o077 != 0)
        .try_for_each(|(path, _)| fs::set_permissions(path, Permissions::from_mode(0o600)))
}

/// The FNV-1a hash, which names a run after its results independently of the build.
fn hash<'a>(bytes: impl Iterator<Item = &'a u8>) -> u64 {
    bytes.fold(0xcbf2_9ce4_8422_2325, |hash, byte| {
        (hash ^ u64::from(*byte)).wrapping_mul(0x100_0000_01b3)
    })
}

#[cfg(test)]
mod tests;
