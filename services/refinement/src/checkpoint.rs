//! The checkpoint: a file with the state of the refinement, from which a restarted process resumes.
//!
//! A local map has no finite look-back, since the keyframes of a stationary vehicle can be arbitrarily old. So the state after
//! each item is written before its motion is published, and a restart restores the state before its first item. The file
//! consists of two rings of fixed-size slots, one of states and one of keyframes, long enough for any restart; it does not grow.
//! Checksums detect slots that were cut short by a death; their items had not been published.

mod codec;
#[cfg(test)]
mod tests;

use std::{
    fs::{File, OpenOptions},
    io,
    os::unix::fs::FileExt,
    path::{Path, PathBuf},
};

use gyre_scan_matching::Refiner;
use thiserror::Error;

use codec::{
    EMPTY, KEYFRAME_WORDS, STATE_BYTES, StateHeader, decode_keyframe, decode_state,
    encode_keyframe, encode_state, keyframe_id,
};

/// The start of the file, with the version of the slots.
const MAGIC: [u8; 16] = *b"gyre map v1     ";
/// Slots in addition to those that a window needs.
const HEADROOM: usize = 8;
/// The largest window. The layout of the file is the same for all windows, so a run can be continued with another one.
const MAX_WINDOW: usize = 66;
/// Number of states in the ring.
const STATES: usize = 2 * MAX_WINDOW + HEADROOM;
/// Bytes of the file's header: the start, the numbers of slots of both rings, the size of a keyframe's slot.
const HEADER_BYTES: usize = 16 + 3 * 8;
/// An error of a checkpoint.
#[derive(Debug, Error)]
pub enum CheckpointError {
    /// The file cannot be read or written.
    #[error("checkpoint {path}: {source}")]
    File {
        /// The file.
        path: PathBuf,
        /// The system error.
        source: io::Error,
    },
    /// The state is not in the file, which is of another version or configuration, or damaged.
    #[error(
        "{path} does not have the state of the refinement before item {item}: start again with --fresh"
    )]
    Missing {
        /// The file.
        path: PathBuf,
        /// The item whose state is missing.
        item: u64,
    },
}

/// An open checkpoint.
#[derive(Debug)]
pub struct Checkpoint {
    path: PathBuf,
    file: File,
    /// Number of keyframes to keep; further slots stay empty.
    kept: usize,
    /// Id of the keyframe in each slot; `None` for an empty slot.
    keyframes: Vec<Option<u64>>,
    /// Buffer for one slot of a keyframe.
    slot: Vec<u8>,
}

/// Returns the path of the checkpoint of the run that writes to `out`.
pub fn path(out: &Path) -> PathBuf {
    out.join("journal").join("refinement.map")
}

impl Checkpoint {
    /// Opens or creates a checkpoint for runs with this window and maps of at most `max_keyframes` keyframes of `cells` cells.
    ///
    /// # Errors
    /// A file that cannot be read or written.
    pub fn open(
        path: &Path,
        window: usize,
        max_keyframes: usize,
        cells: usize,
    ) -> Result<Self, CheckpointError> {
        let failed = |source| CheckpointError::File {
            path: path.to_owned(),
            source,
        };
        if let Some(directory) = path.parent() {
            std::fs::create_dir_all(directory).map_err(failed)?;
        }
        let file = OpenOptions::new()
            .create(true)
            .truncate(false)
            .read(true)
            .write(true)
            .open(path)
            .map_err(failed)?;
        let slots = |window: usize| max_keyframes + 2 * window + HEADROOM;
        let (kept, keyframes) = (slots(window.min(MAX_WINDOW)), vec![None; slots(MAX_WINDOW)]);
        let slot = vec![0; KEYFRAME_WORDS * 8 + cells];
        let mut checkpoint = Self {
            path: path.to_owned(),
            file,
            kept,
            keyframes,
            slot,
        };
        checkpoint.load().map_err(failed)?;
        Ok(checkpoint)
    }

    /// Reads the ids of all keyframes. A file of another layout is overwritten.
    fn load(&mut self) -> io::Result<()> {
        let mut header = [0; HEADER_BYTES];
        let matches = self.file.read_exact_at(&mut header, 0).is_ok() && header == self.header();
        if !matches {
            self.file.set_len(0)?;
            return self.file.write_all_at(&self.header(), 0);
        }
        for k in 0..self.keyframes.len() {
            self.keyframes[k] = self.read_keyframe(k)?;
        }
        Ok(())
    }

    fn header(&self) -> [u8; HEADER_BYTES] {
        let mut header = [0; HEADER_BYTES];
        header[..16].copy_from_slice(&MAGIC);
        for (k, number) in [STATES, self.keyframes.len(), self.slot.len()]
            .into_iter()
            .enumerate()
        {
            header[16 + 8 * k..24 + 8 * k].copy_from_slice(&(number as u64).to_le_bytes());
        }
        header
    }

    fn state_offset(&self, item: u64) -> u64 {
        HEADER_BYTES as u64 + item % STATES as u64 * STATE_BYTES as u64
    }

    fn keyframe_offset(&self, slot: usize) -> u64 {
        (HEADER_BYTES + STATES * STATE_BYTES + slot * self.slot.len()) as u64
    }

    /// Writes the state after `item`: first the new keyframes, then the state that refers to them. If the file has this state
    /// already, the process repeats items after a restart, and nothing is written: later states may still be needed. If it has
    /// another state, all later ones are obsolete.
    ///
    /// # Errors
    /// A file that cannot be written.
    pub fn write(&mut self, item: u64, refiner: &Refiner) -> Result<(), CheckpointError> {
        let (mut keyframes, mut oldest) = (0, u64::MAX);
        for keyframe in refiner.keyframes() {
            (keyframes, oldest) = (keyframes + 1, oldest.min(keyframe.id));
        }
        let header = StateHeader {
            item,
            keyframes,
            oldest,
        };
        let state = encode_state(header, refiner.state());
        if self.read_state(item).is_some_and(|found| found == state) {
            return Ok(());
        }
        let result = self
            .erase_keyframes_from(item)
            .and_then(|()| self.write_keyframes(item, oldest, refiner))
            .and_then(|()| self.file.write_all_at(&state, self.state_offset(item)));
        result.map_err(|source| CheckpointError::File {
            path: self.path.clone(),
            source,
        })
    }

    /// Writes the keyframes that the file does not have.
    fn write_keyframes(&mut self, item: u64, oldest: u64, refiner: &Refiner) -> io::Result<()> {
        for keyframe in refiner.keyframes() {
            let stored = self
                .keyframes
                .iter()
                .position(|slot| *slot == Some(keyframe.id));
            // A map starts with the previous scan, whose keyframe depends on this item too: write it again.
            let starts_map = keyframe.id == oldest && keyframe.id.checked_add(1) == Some(item);
            if stored.is_some() && !starts_map {
                continue;
            }
            let slot = stored.unwrap_or_else(|| self.free_slot());
            self.keyframes[slot] = Some(keyframe.id);
            encode_keyframe(keyframe, &mut self.slot);
            self.file
                .write_all_at(&self.slot, self.keyframe_offset(slot))?;
        }
        Ok(())
    }

    /// Erases the keyframes from `item` on.
    fn erase_keyframes_from(&mut self, item: u64) -> io::Result<()> {
        for slot in 0..self.keyframes.len() {
            if self.keyframes[slot].is_some_and(|id| id >= item) {
                self.file.write_all_at(&EMPTY, self.keyframe_offset(slot))?;
                self.keyframes[slot] = None;
            }
        }
        Ok(())
    }

    /// Returns an empty slot, or that of the oldest keyframe if enough are kept for any restart.
    fn free_slot(&self) -> usize {
        let used = self.keyframes.iter().flatten().count();
        let empty = self
            .keyframes
            .iter()
            .position(Option::is_none)
            .filter(|_| used < self.kept);
        let oldest = || {
            (0..self.keyframes.len())
                .filter(|slot| self.keyframes[*slot].is_some())
                .min_by_key(|slot| self.keyframes[*slot])
        };
        empty.or_else(oldest).unwrap_or(0)
    }

    /// Restores the state after `item`.
    ///
    /// # Errors
    /// [`CheckpointError::Missing`].
    pub fn restore(&mut self, item: u64, refiner: &mut Refiner) -> Result<(), CheckpointError> {
        let missing = || CheckpointError::Missing {
            path: self.path.clone(),
            item: item.saturating_add(1),
        };
        let state = self.read_state(item).ok_or_else(missing)?;
        let (header, tracker) = decode_state(&state).ok_or_else(missing)?;
        if header.item != item {
            return Err(missing());
        }
        let mut wanted: Vec<(u64, usize)> = (0..self.keyframes.len())
            .filter_map(|slot| self.keyframes[slot].map(|id| (id, slot)))
            .filter(|(id, _)| (header.oldest..=item).contains(id))
            .collect();
        wanted.sort_unstable();
        let offsets: Vec<u64> = wanted
            .iter()
            .map(|(_, slot)| self.keyframe_offset(*slot))
            .collect();
        let mut offsets = offsets.into_iter();
        refiner.restore(tracker, |keyframe| {
            offsets.next().is_some_and(|offset| {
                self.file.read_exact_at(&mut self.slot, offset).is_ok()
                    && decode_keyframe(&self.slot, keyframe)
            })
        });
        if refiner.keyframes().count() as u64 == header.keyframes {
            Ok(())
        } else {
            Err(missing())
        }
    }

    /// Reads the slot of an item's state; `None` if the file ends before it.
    fn read_state(&self, item: u64) -> Option<[u8; STATE_BYTES]> {
        let mut state = [0; STATE_BYTES];
        self.file
            .read_exact_at(&mut state, self.state_offset(item))
            .ok()
            .map(|()| state)
    }

    /// Reads the id of the keyframe in a slot; `None` if its checksum is wrong.
    fn read_keyframe(&mut self, slot: usize) -> io::Result<Option<u64>> {
        let offset = self.keyframe_offset(slot);
        match self.file.read_exact_at(&mut self.slot, offset) {
            Ok(()) => Ok(keyframe_id(&self.slot)),
            Err(error) if error.kind() == io::ErrorKind::UnexpectedEof => Ok(None),
            Err(error) => Err(error),
        }
    }
}
