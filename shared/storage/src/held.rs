//! Writes that wait in memory until a full disk has room again.

use std::{
    collections::VecDeque,
    sync::atomic::{AtomicBool, AtomicUsize, Ordering},
    time::{Duration, Instant},
};

use crate::StorageError;

/// The most bytes that the files of a process hold together: hours of poses, or minutes of scans.
const MOST: usize = 64 << 20;
/// Time between two attempts to write.
const PAUSE: Duration = Duration::from_secs(1);

/// True if this process continues while its disk is full.
static CONTINUES: AtomicBool = AtomicBool::new(false);
static WAS_FULL: AtomicBool = AtomicBool::new(false);
static IS_LOST: AtomicBool = AtomicBool::new(false);
static HELD: AtomicUsize = AtomicUsize::new(0);

/// The writes of this process, as far as they depend on the room of its disk.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Disk {
    HasRoom,
    /// Writes are held in memory until there is room.
    IsFull,
    /// It was full until the memory for writes was used up, and later writes are lost. True if
    /// there was room again for all that were held.
    Lost(bool),
}

/// Lets this process continue when the disk is full: its changes in place are held in memory, and
/// written when there is room again.
pub fn continue_when_full() {
    CONTINUES.store(true, Ordering::Relaxed);
}

#[must_use]
pub fn disk() -> Disk {
    let is_held = HELD.load(Ordering::Relaxed) > 0;
    match (IS_LOST.load(Ordering::Relaxed), is_held) {
        (true, is_held) => Disk::Lost(!is_held),
        (false, true) => Disk::IsFull,
        (false, false) => Disk::HasRoom,
    }
}

/// Returns whether a write of this process in place has failed because the disk was full.
#[must_use]
pub fn was_full() -> bool {
    WAS_FULL.load(Ordering::Relaxed)
}

/// Returns false if the disk is full, and this process continues.
pub(crate) fn unless_full(done: Result<(), StorageError>) -> Result<bool, StorageError> {
    match done {
        Err(error) if error.is_full() => {
            WAS_FULL.store(true, Ordering::Relaxed);
            match CONTINUES.load(Ordering::Relaxed) {
                true => Ok(false),
                false => Err(error),
            }
        }
        done => done.map(|()| true),
    }
}

/// Gives up all later writes of this process, because its files may not have gaps.
pub(crate) fn lose() {
    IS_LOST.store(true, Ordering::Relaxed);
}

pub(crate) fn is_lost() -> bool {
    IS_LOST.load(Ordering::Relaxed)
}

/// The writes of a file that wait, the oldest first: the offset of each, and its bytes.
#[derive(Debug, Default)]
pub(crate) struct Held {
    writes: VecDeque<(u64, Vec<u8>)>,
    tried: Option<Instant>,
}

impl Held {
    pub fn is_empty(&self) -> bool {
        self.writes.is_empty()
    }

    pub fn is_due(&self) -> bool {
        self.tried.is_none_or(|tried| tried.elapsed() >= PAUSE)
    }

    /// Notes whether an attempt has found the disk full.
    pub fn note_attempt(&mut self, was_full: bool) {
        self.tried = was_full.then(Instant::now);
    }

    pub fn push(&mut self, offset: u64, bytes: &[u8]) {
        if is_lost() {
            return;
        }
        // A file of slots stays as small in memory as on the disk.
        let is_replaced = |(at, old): &(u64, Vec<u8>)| *at == offset && old.len() <= bytes.len();
        if self.writes.back().is_some_and(|(at, _)| offset <= *at)
            && let Some(old) = self.writes.iter().position(is_replaced)
        {
            self.remove(old);
        }
        match HELD.load(Ordering::Relaxed) + bytes.len() > MOST {
            true => lose(),
            false => {
                HELD.fetch_add(bytes.len(), Ordering::Relaxed);
                self.writes.push_back((offset, bytes.to_vec()));
            }
        }
    }

    pub fn front(&self) -> Option<(u64, &[u8])> {
        let (offset, bytes) = self.writes.front()?;
        Some((*offset, bytes))
    }

    pub fn pop(&mut self) {
        self.remove(0);
    }

    /// Drops the writes behind the end of a file that is cut to this length.
    pub fn cut(&mut self, length: u64) {
        while let Some(behind) = self.writes.iter().position(|(at, _)| *at >= length) {
            self.remove(behind);
        }
    }

    fn remove(&mut self, index: usize) {
        if let Some((_, bytes)) = self.writes.remove(index) {
            HELD.fetch_sub(bytes.len(), Ordering::Relaxed);
        }
    }
}

impl Drop for Held {
    fn drop(&mut self) {
        self.cut(0);
    }
}
