//! Synchronisation of a file in the background.

use std::{
    io,
    sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError},
    thread::{self, JoinHandle},
    time::{Duration, Instant},
};

use crate::{File, StorageError};

/// Synchronises a file on a thread of its own, for many changes at once: a synchronisation takes
/// milliseconds, too long for each of a hundred changes in a second.
///
/// At most [`GroupSync::LIMIT`] changes are in danger of a power failure, and none for much longer
/// than [`GroupSync::INTERVAL`].
#[derive(Debug)]
pub struct GroupSync {
    file: File,
    shared: Arc<Shared>,
    worker: Option<JoinHandle<()>>,
}

#[derive(Debug)]
struct Shared {
    progress: Mutex<Progress>,
    changed: Condvar,
}

#[derive(Debug, Default)]
struct Progress {
    made: u64,
    safe: u64,
    /// The number of changes that somebody waits for.
    awaited: u64,
    ending: bool,
    /// Why a synchronisation has failed. No synchronisation follows it.
    failure: Option<(io::ErrorKind, String)>,
}

impl Shared {
    fn lock(&self) -> MutexGuard<'_, Progress> {
        self.progress.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn wait<'a>(&self, progress: MutexGuard<'a, Progress>) -> MutexGuard<'a, Progress> {
        self.changed
            .wait(progress)
            .unwrap_or_else(PoisonError::into_inner)
    }

    /// Waits until it is time for a synchronisation; returns the number of changes that it covers,
    /// or `None` at the end. Changes that wait for room on the disk are covered once they are
    /// written.
    fn next(&self, file: &File, last: Option<Instant>) -> Option<u64> {
        let mut progress = self.lock();
        loop {
            let (pending, is_behind) = (progress.made - progress.safe, file.is_behind());
            let is_done = pending == 0 || is_behind;
            if progress.failure.is_some() || (is_done && progress.ending) {
                return None;
            }
            if pending == 0 {
                progress = self.wait(progress);
                continue;
            }
            let elapsed = last.map_or(GroupSync::INTERVAL, |last| last.elapsed());
            let left = GroupSync::INTERVAL.saturating_sub(elapsed);
            let is_urgent = progress.ending || progress.awaited > progress.safe;
            if !is_behind && (left.is_zero() || is_urgent || pending >= GroupSync::LIMIT / 2) {
                return Some(progress.made);
            }
            let limit = if is_behind { GroupSync::INTERVAL } else { left };
            let waited = self.changed.wait_timeout(progress, limit);
            progress = waited.unwrap_or_else(PoisonError::into_inner).0;
        }
    }

    fn work(&self, file: &File) {
        let mut last = None;
        while let Some(covered) = self.next(file, last) {
            last = Some(Instant::now());
            let synchronised = file.sync();
            let mut progress = self.lock();
            match synchronised {
                Ok(()) => progress.safe = covered,
                Err(StorageError { source, .. }) => {
                    progress.failure = Some((source.kind(), source.to_string()));
                }
            }
            self.changed.notify_all();
        }
    }
}

impl GroupSync {
    /// The largest number of changes that a power failure can take.
    pub const LIMIT: u64 = 32;
    /// The time between two synchronisations, unless half of [`Self::LIMIT`] is reached before.
    pub const INTERVAL: Duration = Duration::from_secs(1);

    /// Starts with a synchronisation of what earlier processes may have written.
    pub fn start(file: &File) -> Result<Self, StorageError> {
        let shared = Arc::new(Shared {
            progress: Mutex::new(Progress {
                made: 1,
                ..Progress::default()
            }),
            changed: Condvar::new(),
        });
        let (of_worker, for_worker) = (Arc::clone(&shared), file.try_clone()?);
        let file = file.try_clone()?;
        let worker = thread::Builder::new()
            .name("sync".to_owned())
            .spawn(move || of_worker.work(&for_worker))
            .map_err(StorageError::at("synchronise", file.path()))?;
        Ok(Self {
            file,
            shared,
            worker: Some(worker),
        })
    }

    /// Counts a change that has been made. Waits while [`Self::LIMIT`] are in danger, but not for
    /// room on the disk.
    /// Fails if an earlier synchronisation has failed, because changes may be lost.
    pub fn changed(&self) -> Result<(), StorageError> {
        let mut progress = self.shared.lock();
        progress.made += 1;
        let pending = progress.made - progress.safe;
        // The thread is woken when there is something to do for it, not each time.
        if pending == 1 || pending == Self::LIMIT / 2 {
            self.shared.changed.notify_all();
        }
        while progress.made - progress.safe > Self::LIMIT
            && progress.failure.is_none()
            && !self.file.is_behind()
        {
            self.shared.changed.notify_all();
            progress = self.shared.wait(progress);
        }
        self.result(&progress)
    }

    /// Waits until all changes are safe for which the disk has room. Dropped without that, nobody
    /// learns of a failure.
    /// Fails if an earlier synchronisation has failed, because changes may be lost.
    pub fn finish(&self) -> Result<(), StorageError> {
        self.file.write_all_held()?;
        let mut progress = self.shared.lock();
        let made = progress.made;
        progress.awaited = made;
        self.shared.changed.notify_all();
        while progress.safe < made && progress.failure.is_none() && !self.file.is_behind() {
            progress = self.shared.wait(progress);
        }
        self.result(&progress)
    }

    fn result(&self, progress: &Progress) -> Result<(), StorageError> {
        match &progress.failure {
            None => Ok(()),
            Some((kind, reason)) => Err(StorageError::at("synchronise", self.file.path())(
                io::Error::new(*kind, reason.clone()),
            )),
        }
    }

    /// Returns the number of changes that are safe; `None` until the first synchronisation has
    /// ended.
    pub fn safe(&self) -> Option<u64> {
        self.shared.lock().safe.checked_sub(1)
    }
}

impl Drop for GroupSync {
    fn drop(&mut self) {
        self.shared.lock().ending = true;
        self.shared.changed.notify_all();
        if let Some(worker) = self.worker.take() {
            let _ = worker.join();
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_more_changes_than_the_limit_are_in_danger_and_none_at_the_end() {
        let folder = tempfile::tempdir().unwrap();
        let file = File::open_or_create(&folder.path().join("file")).unwrap();
        let group = GroupSync::start(&file).unwrap();
        for change in 1..=10 * GroupSync::LIMIT {
            file.write_at(b"x", change).unwrap();
            group.changed().unwrap();
            let safe = group.safe().unwrap_or(0);
            assert!(change - safe <= GroupSync::LIMIT, "{safe} of {change}");
        }
        group.finish().unwrap();
        assert_eq!(group.safe(), Some(10 * GroupSync::LIMIT));
        let shared = Arc::clone(&group.shared);
        drop(group);
        let progress = shared.lock();
        assert_eq!(progress.safe, progress.made);
    }

    /// The system does not synchronise a device that forgets all.
    #[test]
    fn a_failure_of_the_last_synchronisation_is_reported() {
        let file = File::open_or_create(std::path::Path::new("/dev/null")).unwrap();
        let group = GroupSync::start(&file).unwrap();
        for _ in 0..2 {
            let failed = group.finish().unwrap_err().to_string();
            assert!(
                failed.starts_with("cannot synchronise /dev/null: "),
                "{failed}"
            );
        }
        assert_eq!(group.safe(), None);
    }
}
