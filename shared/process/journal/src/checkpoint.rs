//! The checkpoint: a file with the state of the refinement, for resuming a restarted process.
//!
//! A local map has no finite look-back, so the state after each item is written before its motion
//! is published, and a restart restores the state before its first item. The file is two rings of
//! slots with checksums, one of states and one of keyframes, long enough for any restart.
//!
//! After a power failure, any part of the last second's writes may be there or not. So a state
//! names its keyframes by their content, and the motion that it led to:
//! [`Checkpoint::newest_known`] finds the last pose of a journal whose state is whole.

mod slot;

use std::{
    mem,
    path::{Path, PathBuf},
};

use gyre_contract::{MotionEstimate, PoseHeader, run::REFINEMENT_STATE};
use gyre_matching::{Refiner, TrackerState};
use gyre_storage::{DurableFile, GroupSync, LogError, Slots, StorageError};

use slot::{
    EMPTY, Name, State, decode_keyframe, decode_state, encode_keyframe, encode_state,
    keyframe_bytes, keyframe_name, state_bytes,
};

/// The start of the file, with the version of the slots.
const MAGIC: [u8; 16] = *b"gyre map v13    ";
/// The largest window. The layout of the file is the same for all windows, so a run can be
/// continued with a different window.
const MAX_WINDOW: usize = 66;
const STATES: usize = look_back(MAX_WINDOW);
/// Bytes of the file's header: the start, the numbers of slots of both rings, the sizes of a
/// state's and a keyframe's slot.
const HEADER_BYTES: usize = 16 + 4 * 8;

/// Number of items that a restart can go back, from the newest state: by two windows after a death,
/// and by all unsynchronised items after a power failure.
const fn look_back(window: usize) -> usize {
    const HEADROOM: usize = 8;
    2 * window + GroupSync::LIMIT as usize + HEADROOM
}

#[derive(Debug)]
pub struct Checkpoint {
    file: DurableFile,
    layout: Layout,
    /// Number of keyframes to keep; further slots stay empty.
    kept: usize,
    /// The keyframe in each slot; `None` for an empty slot.
    keyframes: Vec<Option<Name>>,
    /// The keyframes of the last state that was written or restored, oldest first, and the
    /// keyframes of the state before it.
    map: Vec<Name>,
    earlier_map: Vec<Name>,
    /// Memory for the slot of a state, for the one that is in the file, and for a keyframe's.
    state: Vec<u8>,
    found: Vec<u8>,
    keyframe: Vec<u8>,
}

#[derive(Clone, Copy, Debug)]
struct Layout {
    states: Slots,
    keyframes: Slots,
    count: usize,
}

pub fn path(out: &Path) -> PathBuf {
    out.join(REFINEMENT_STATE)
}

/// Returns the checksum of a motion, which links a state to a pose.
pub fn checksum(motion: &MotionEstimate) -> u64 {
    crc32fast::hash(bytemuck::bytes_of(motion)).into()
}

/// The state is not in the checkpoint, which is of another version or configuration, or damaged.
pub fn no_state(checkpoint: &Path, item: u64) -> LogError {
    LogError::Missing(format!(
        "{} does not have the state of the refinement before item {item}: start again with --fresh",
        checkpoint.display()
    ))
}

fn slot_of(item: u64) -> u64 {
    item % STATES as u64
}

impl Layout {
    fn of(max_keyframes: usize, cells: usize) -> Self {
        let states = Slots {
            start: HEADER_BYTES as u64,
            bytes: state_bytes(max_keyframes),
        };
        let keyframes = Slots {
            start: states.offset(STATES as u64),
            bytes: keyframe_bytes(cells),
        };
        Self {
            states,
            keyframes,
            count: max_keyframes + look_back(MAX_WINDOW),
        }
    }

    fn header(&self) -> [u8; HEADER_BYTES] {
        let mut header = [0; HEADER_BYTES];
        header[..16].copy_from_slice(&MAGIC);
        let sizes = [self.states.bytes, self.keyframes.bytes];
        for (k, number) in [STATES, self.count].into_iter().chain(sizes).enumerate() {
            header[16 + 8 * k..24 + 8 * k].copy_from_slice(&(number as u64).to_le_bytes());
        }
        header
    }
}

impl Checkpoint {
    /// Opens or creates a checkpoint for runs with this window and maps of at most `max_keyframes`
    /// keyframes of `cells` cells.
    pub fn open(
        path: &Path,
        window: usize,
        max_keyframes: usize,
        cells: usize,
    ) -> Result<Self, LogError> {
        let layout = Layout::of(max_keyframes, cells);
        let file = DurableFile::open(path, |file| {
            let (header, mut found) = (layout.header(), [0; HEADER_BYTES]);
            // A file of another layout becomes an empty one.
            if !file.read_at(&mut found, 0)? || found != header {
                file.set_length(0)?;
                file.write_at(&header, 0)?;
            }
            Ok::<(), LogError>(())
        })?;
        let mut checkpoint = Self {
            file,
            layout,
            kept: max_keyframes + look_back(window.min(MAX_WINDOW)),
            keyframes: Vec::with_capacity(layout.count),
            map: Vec::with_capacity(max_keyframes),
            earlier_map: Vec::with_capacity(max_keyframes),
            state: vec![0; layout.states.bytes],
            found: vec![0; layout.states.bytes],
            keyframe: vec![0; layout.keyframes.bytes],
        };
        for slot in 0..layout.count as u64 {
            let slots = &layout.keyframes;
            let is_there = checkpoint
                .file
                .read(slots, slot, &mut checkpoint.keyframe)?;
            let name = keyframe_name(&checkpoint.keyframe).filter(|_| is_there);
            checkpoint.keyframes.push(name);
        }
        Ok(checkpoint)
    }

    /// Writes the state after `item`, which led to a motion with this checksum: first the new
    /// keyframes, then the state that names them. If the file has this state already, the process
    /// repeats items after a restart, and it is left: later states may still be needed. If it has
    /// another state, all later ones are obsolete.
    pub fn write(&mut self, item: u64, motion: u64, refiner: &Refiner) -> Result<(), LogError> {
        self.name_keyframes(item, refiner);
        let (states, slot) = (self.layout.states, slot_of(item));
        let state = State {
            item,
            motion,
            tracker: *refiner.state(),
            keyframes: &self.map[..],
        };
        encode_state(&state, &mut self.state);
        let is_there = self.file.read(&states, slot, &mut self.found)?;
        let known = is_there && self.found == self.state;
        if !known {
            self.erase_keyframes_from(item)?;
        }
        self.write_keyframes(refiner)?;
        if !known {
            self.file.write(&states, slot, &self.state)?;
            self.file.sync.changed()?;
        }
        Ok(())
    }

    /// Names the keyframes of the map. A keyframe does not change while it is in the map.
    fn name_keyframes(&mut self, item: u64, refiner: &Refiner) {
        mem::swap(&mut self.map, &mut self.earlier_map);
        self.map.clear();
        for (k, keyframe) in refiner.keyframes().enumerate() {
            // A map starts with the previous scan, which may have been in the map before as well.
            let starts_map = k == 0 && keyframe.id.checked_add(1) == Some(item);
            let mut earlier = self.earlier_map.iter();
            let named = earlier.find(|name| name.id == keyframe.id && !starts_map);
            let name = named.copied();
            let name = name.unwrap_or_else(|| encode_keyframe(keyframe, &mut self.keyframe));
            self.map.push(name);
        }
    }

    /// Writes the keyframes of the map that the file does not have.
    fn write_keyframes(&mut self, refiner: &Refiner) -> Result<(), StorageError> {
        for (k, keyframe) in refiner.keyframes().enumerate() {
            let name = self.map[k];
            if self.keyframes.contains(&Some(name)) {
                continue;
            }
            encode_keyframe(keyframe, &mut self.keyframe);
            let (slots, slot) = (self.layout.keyframes, self.free_slot());
            self.keyframes[slot] = Some(name);
            self.file.write(&slots, slot as u64, &self.keyframe)?;
        }
        Ok(())
    }

    /// Erases the keyframes from `item` on that are not in the map.
    fn erase_keyframes_from(&mut self, item: u64) -> Result<(), StorageError> {
        for slot in 0..self.keyframes.len() {
            let obsolete = |name: &Name| name.id >= item && !self.map.contains(name);
            if self.keyframes[slot].as_ref().is_some_and(obsolete) {
                let slots = &self.layout.keyframes;
                self.file.write(slots, slot as u64, &EMPTY)?;
                self.keyframes[slot] = None;
            }
        }
        Ok(())
    }

    /// Returns an empty slot, or the slot of the oldest keyframe if enough are kept for any
    /// restart.
    fn free_slot(&self) -> usize {
        let used = self.keyframes.iter().flatten().count();
        let mut slots = self.keyframes.iter();
        let empty = slots.position(Option::is_none);
        let named = self.keyframes.iter().enumerate();
        let oldest = named.filter(|(_, name)| name.is_some());
        let oldest = oldest.min_by_key(|(_, name)| **name).map(|(slot, _)| slot);
        let empty = empty.filter(|_| used < self.kept);
        empty.or(oldest).unwrap_or(0)
    }

    /// Reads the state after `item` with the checksum of its motion, and the names of its
    /// keyframes; `None` if the file does not have it whole.
    fn read_state(&mut self, item: u64) -> Result<Option<(u64, TrackerState)>, StorageError> {
        let states = &self.layout.states;
        let whole = self.file.read(states, slot_of(item), &mut self.found)?;
        let state = decode_state(&self.found);
        let state = state.filter(|state| whole && state.item == item);
        Ok(state.map(|state| {
            self.map.clear();
            self.map.extend(state.keyframes);
            (state.motion, state.tracker)
        }))
    }

    pub fn restore(&mut self, item: u64, refiner: &mut Refiner) -> Result<(), LogError> {
        let path = self.file.file.path();
        let missing = no_state(path, item.saturating_add(1));
        let Some((_, tracker)) = self.read_state(item)? else {
            return Err(missing);
        };
        let places: Vec<Option<u64>> = self.map.iter().map(|name| self.place_of(*name)).collect();
        let mut keyframes = self.map.iter().zip(places);
        let (file, slots) = (&self.file, &self.layout.keyframes);
        let bytes = &mut self.keyframe;
        refiner.restore(tracker, |keyframe| {
            let Some((name, Some(slot))) = keyframes.next() else {
                return false;
            };
            file.read(slots, slot, bytes).is_ok_and(|whole| whole)
                && decode_keyframe(bytes, *name, keyframe)
        });
        match refiner.keyframes().count() == self.map.len() {
            true => Ok(()),
            false => Err(missing),
        }
    }

    fn place_of(&self, name: Name) -> Option<u64> {
        let slot = self.keyframes.iter().position(|slot| *slot == Some(name));
        slot.map(|slot| slot as u64)
    }

    /// Returns the newest of these poses, given newest first, that a run can continue from: the one
    /// whose whole state is in the file.
    pub fn newest_known<'a>(
        &mut self,
        poses: impl IntoIterator<Item = &'a PoseHeader>,
    ) -> Result<Option<&'a PoseHeader>, LogError> {
        for pose in poses {
            let motion = checksum(&pose.motion);
            let state = self.read_state(pose.item.seq)?;
            if state.is_some_and(|(led_to, _)| led_to == motion)
                && self.map.iter().all(|name| self.place_of(*name).is_some())
            {
                return Ok(Some(pose));
            }
        }
        Ok(None)
    }
}
