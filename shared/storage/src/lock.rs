//! Locks of files: never waited for without a limit, and with the name of who holds them.

use std::{
    fs::{self, File, OpenOptions},
    io,
    os::{
        fd::AsFd,
        unix::fs::{MetadataExt, OpenOptionsExt},
    },
    path::Path,
};

use rustix::{
    fs::{FlockOperation, OFlags, flock, fstat, major, minor},
    io::Errno,
};

#[derive(Debug)]
pub enum Attempt {
    /// It is locked as long as this file is open.
    Locked(File),
    /// Another process holds the lock: `process 123 (gyre)`, if the system reports it.
    Held(Option<String>),
}

/// Creates and locks a file, without waiting. The file is the owner's alone.
pub fn try_lock(path: &Path) -> io::Result<Attempt> {
    lock(path, true)
}

/// Locks a file that exists, without waiting.
pub fn try_lock_existing(path: &Path) -> io::Result<Attempt> {
    lock(path, false)
}

fn lock(path: &Path, create: bool) -> io::Result<Attempt> {
    let file = OpenOptions::new()
        .create(create)
        .truncate(false)
        .write(true)
        .mode(0o600)
        // A pipe in its place would be waited for.
        .custom_flags((OFlags::NOFOLLOW | OFlags::NONBLOCK).bits() as i32)
        .open(path)?;
    attempt(&file, path)
}

pub(crate) fn attempt(file: &File, path: &Path) -> io::Result<Attempt> {
    match flock(file, FlockOperation::NonBlockingLockExclusive) {
        Ok(()) if is_at(file, path)? => Ok(Attempt::Locked(file.try_clone()?)),
        // Its last owner has removed it meanwhile.
        Ok(()) => Ok(Attempt::Held(None)),
        Err(Errno::WOULDBLOCK) => Ok(Attempt::Held(holder(file))),
        Err(error) => Err(error.into()),
    }
}

fn is_at(file: &File, path: &Path) -> io::Result<bool> {
    let opened = file.metadata()?;
    match fs::symlink_metadata(path) {
        Ok(there) => Ok((there.dev(), there.ino()) == (opened.dev(), opened.ino())),
        Err(error) if error.kind() == io::ErrorKind::NotFound => Ok(false),
        Err(error) => Err(error),
    }
}

/// Returns the process that holds the lock of a file, as the kernel lists it.
fn holder(file: impl AsFd) -> Option<String> {
    // The list is read in pieces: where another lock is released meanwhile, one can be missing.
    const READINGS: usize = 20;
    let status = fstat(file).ok()?;
    let (major, minor) = (major(status.st_dev), minor(status.st_dev));
    let id = format!("{major:02x}:{minor:02x}:{}", status.st_ino);
    let pid = (0..READINGS).find_map(|_| listed(&id))?;
    let name = fs::read_to_string(format!("/proc/{pid}/comm")).ok()?;
    Some(format!("process {pid} ({})", name.trim_end()))
}

/// Returns the process that is listed with the lock of a file; `id` is the device's numbers and the
/// inode.
fn listed(id: &str) -> Option<String> {
    let locks = fs::read_to_string("/proc/locks").ok()?;
    locks.lines().find_map(|line| {
        let fields: Vec<&str> = line.split_whitespace().collect();
        match fields[..] {
            [_, "FLOCK", _, _, pid, file, ..] if file == id => Some(pid.to_owned()),
            _ => None,
        }
    })
}

#[cfg(test)]
mod tests {
    use std::os::unix::fs::PermissionsExt;

    use super::*;

    #[test]
    fn a_held_lock_is_reported_with_its_process() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("lock");
        let Attempt::Locked(held) = try_lock(&path).unwrap() else {
            panic!("it is held by nobody");
        };
        let Attempt::Held(Some(holder)) = try_lock(&path).unwrap() else {
            panic!("it is held, and the kernel lists it");
        };
        let ours = format!("process {} (", std::process::id());
        assert!(holder.starts_with(&ours), "{holder}");
        drop(held);
        assert!(matches!(try_lock(&path).unwrap(), Attempt::Locked(_)));
    }

    #[test]
    fn a_lock_that_is_not_there_is_not_created() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("lock");
        let error = try_lock_existing(&path).unwrap_err();
        assert_eq!(error.kind(), io::ErrorKind::NotFound);
        assert!(!path.exists());
        drop(try_lock(&path).unwrap());
        let there = try_lock_existing(&path).unwrap();
        assert!(matches!(there, Attempt::Locked(_)));
        let mode = fs::metadata(&path).unwrap().permissions().mode();
        assert_eq!(mode & 0o077, 0, "it is the owner's alone: {mode:o}");
    }

    #[test]
    fn a_lock_is_not_taken_through_a_link() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("lock");
        std::os::unix::fs::symlink(folder.path().join("elsewhere"), &path).unwrap();
        assert!(try_lock(&path).is_err());
    }
}
