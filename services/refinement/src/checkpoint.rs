//! What the refinement remembers, kept in a file so that a restart goes on where the last life stood.
//!
//! A local map has no finite look-back: a standing vehicle's keyframes are as old as one likes. So the state after each item
//! is written before its motion is published, and a restart takes up the state before its first item. The file is two
//! rings of fixed slots, one of states and one of keyframes, as long as any restart can ask for; it does not grow. A slot cut
//! short by a death is found by its check word; what it was for had not been published.

#[cfg(test)]
mod tests;

use std::{
    fs::{File, OpenOptions},
    io,
    os::unix::fs::FileExt,
    path::{Path, PathBuf},
};

use gyre_geometry::Twist;
use gyre_scan_matching::{Anchor, Keyframe, Refiner, TrackerState};
use nalgebra::{Complex, Isometry2, Translation2, UnitComplex};
use thiserror::Error;

/// What the file starts with; the number is the version of its slots.
const MAGIC: [u8; 16] = *b"gyre map v1     ";
/// Slots beyond those that a window needs.
const AIR: usize = 8;
/// The largest window: the file's shape is the same for all of them, so that a run goes on with another one.
const LARGEST_WINDOW: usize = 66;
/// States in the ring.
const STATES: usize = 2 * LARGEST_WINDOW + AIR;
/// Words of a state's slot: the item, the number of keyframes and the oldest one's number; the memory; the check word.
const STATE_WORDS: usize = 3 + MEMORY_WORDS + 1;
const STATE_BYTES: usize = STATE_WORDS * 8;
const MEMORY_WORDS: usize = 4 + 2 * ANCHOR_WORDS + 4;
const ANCHOR_WORDS: usize = 9;
/// Words of a keyframe's slot before its cells: check word, number, pose, corners.
const KEYFRAME_WORDS: usize = 2 + 4 + 4;

/// Why a checkpoint cannot be used.
#[derive(Debug, Error)]
pub enum CheckpointError {
    /// The file.
    #[error("checkpoint {path}: {source}")]
    File {
        /// Which.
        path: PathBuf,
        /// What the operating system said.
        source: io::Error,
    },
    /// Another version's or another configuration's, or damaged.
    #[error(
        "{path} does not hold what the refinement knew before item {item}: begin again with --fresh"
    )]
    Missing {
        /// Which file.
        path: PathBuf,
        /// The item whose state is missing.
        item: u64,
    },
}

/// The file.
#[derive(Debug)]
pub struct Checkpoint {
    path: PathBuf,
    file: File,
    /// Keyframes that are kept; slots beyond them stay empty.
    kept: usize,
    /// The keyframe in each slot of the other ring; `None` where there is none.
    keyframes: Vec<Option<u64>>,
    /// Bytes of a keyframe's slot; the buffer for one.
    slot: Vec<u8>,
}

/// Where the checkpoint of the run that writes to `out` lies.
pub fn path(out: &Path) -> PathBuf {
    out.join("journal").join("refinement.map")
}

impl Checkpoint {
    /// Opens or begins the file: for runs with this window, and keyframes of this many cells of which a map has at most `most`.
    pub fn open(
        path: &Path,
        window: usize,
        most: usize,
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
        let slots = |window: usize| most + 2 * window + AIR;
        let (kept, keyframes) = (
            slots(window.min(LARGEST_WINDOW)),
            vec![None; slots(LARGEST_WINDOW)],
        );
        let slot = vec![0; KEYFRAME_WORDS * 8 + cells];
        let mut checkpoint = Self {
            path: path.to_owned(),
            file,
            kept,
            keyframes,
            slot,
        };
        checkpoint.begin().map_err(failed)?;
        Ok(checkpoint)
    }

    /// A file of another shape is none of this run's: it is begun anew.
    fn begin(&mut self) -> io::Result<()> {
        let mut head = [0; HEAD_BYTES];
        let found = self.file.read_exact_at(&mut head, 0).is_ok() && head == self.head();
        if !found {
            self.file.set_len(0)?;
            return self.file.write_all_at(&self.head(), 0);
        }
        for k in 0..self.keyframes.len() {
            self.keyframes[k] = self.read_keyframe(k)?;
        }
        Ok(())
    }

    /// The version and the slots' numbers and sizes.
    fn head(&self) -> [u8; HEAD_BYTES] {
        let mut head = [0; HEAD_BYTES];
        head[..16].copy_from_slice(&MAGIC);
        for (k, number) in [STATES, self.keyframes.len(), self.slot.len()]
            .into_iter()
            .enumerate()
        {
            head[16 + 8 * k..24 + 8 * k].copy_from_slice(&(number as u64).to_le_bytes());
        }
        head
    }

    fn state_at(&self, item: u64) -> u64 {
        HEAD_BYTES as u64 + item % STATES as u64 * STATE_BYTES as u64
    }

    fn keyframe_at(&self, slot: usize) -> u64 {
        (HEAD_BYTES + STATES * STATE_BYTES + slot * self.slot.len()) as u64
    }

    /// Writes what is known after `item`: first the keyframes that are new, then the state that speaks of them. Where the file
    /// says the same already, an earlier life is being repeated and nothing is written: what that life knew later may still
    /// be asked for. Where it says otherwise, what it says of later items is of no use any more.
    pub fn write(&mut self, item: u64, refinement: &Refiner) -> Result<(), CheckpointError> {
        let (mut count, mut oldest) = (0_u64, u64::MAX);
        for keyframe in refinement.keyframes() {
            (count, oldest) = (count + 1, oldest.min(keyframe.id));
        }
        let state = encode_state([item, count, oldest], refinement.state());
        if self.read_state(item).is_some_and(|found| found == state) {
            return Ok(());
        }
        let result = self
            .forget_from(item)
            .and_then(|()| self.write_new(item, oldest, refinement));
        let result = result.and_then(|()| self.file.write_all_at(&state, self.state_at(item)));
        result.map_err(|source| CheckpointError::File {
            path: self.path.clone(),
            source,
        })
    }

    fn write_new(&mut self, item: u64, oldest: u64, refinement: &Refiner) -> io::Result<()> {
        for keyframe in refinement.keyframes() {
            let known = self
                .keyframes
                .iter()
                .position(|slot| *slot == Some(keyframe.id));
            // A map begins with the scan before the item at hand, seen in the light of this one.
            let begun = keyframe.id == oldest && keyframe.id.checked_add(1) == Some(item);
            if known.is_some() && !begun {
                continue;
            }
            let slot = known.unwrap_or_else(|| self.free_slot());
            self.keyframes[slot] = Some(keyframe.id);
            encode_keyframe(keyframe, &mut self.slot);
            self.file.write_all_at(&self.slot, self.keyframe_at(slot))?;
        }
        Ok(())
    }

    /// Leaves out the keyframes from `item` on.
    fn forget_from(&mut self, item: u64) -> io::Result<()> {
        for slot in 0..self.keyframes.len() {
            if self.keyframes[slot].is_some_and(|id| id >= item) {
                self.file
                    .write_all_at(&NO_CHECK_WORD, self.keyframe_at(slot))?;
                self.keyframes[slot] = None;
            }
        }
        Ok(())
    }

    /// An empty slot, or that of the oldest keyframe where as many are kept as a restart can ask for.
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

    /// Makes the refinement what it was after `item`.
    pub fn restore(&mut self, item: u64, refinement: &mut Refiner) -> Result<(), CheckpointError> {
        let missing = || CheckpointError::Missing {
            path: self.path.clone(),
            item: item.saturating_add(1),
        };
        let state = self.read_state(item).ok_or_else(missing)?;
        let ([found, count, oldest], memory) = decode_state(&state).ok_or_else(missing)?;
        if found != item {
            return Err(missing());
        }
        let mut wanted: Vec<(u64, usize)> = (0..self.keyframes.len())
            .filter_map(|slot| self.keyframes[slot].map(|id| (id, slot)))
            .filter(|(id, _)| (oldest..=item).contains(id))
            .collect();
        wanted.sort_unstable();
        let places: Vec<u64> = wanted
            .iter()
            .map(|(_, slot)| self.keyframe_at(*slot))
            .collect();
        let mut places = places.into_iter();
        refinement.restore(memory, |keyframe| {
            let place = places.next();
            place.is_some_and(|at| {
                self.file.read_exact_at(&mut self.slot, at).is_ok()
                    && decode_keyframe(&self.slot, keyframe)
            })
        });
        if refinement.keyframes().count() as u64 == count {
            Ok(())
        } else {
            Err(missing())
        }
    }

    /// What lies in an item's slot; `None` where the file ends before it.
    fn read_state(&self, item: u64) -> Option<[u8; STATE_BYTES]> {
        let mut state = [0; STATE_BYTES];
        self.file
            .read_exact_at(&mut state, self.state_at(item))
            .ok()
            .map(|()| state)
    }

    /// The number of the keyframe in a slot, if it is whole.
    fn read_keyframe(&mut self, slot: usize) -> io::Result<Option<u64>> {
        let at = self.keyframe_at(slot);
        match self.file.read_exact_at(&mut self.slot, at) {
            Ok(()) => Ok(sound(&self.slot).then(|| word(&self.slot, 1))),
            Err(error) if error.kind() == io::ErrorKind::UnexpectedEof => Ok(None),
            Err(error) => Err(error),
        }
    }
}

const HEAD_BYTES: usize = 16 + 3 * 8;
/// What the slot of no keyframe begins with.
const NO_CHECK_WORD: [u8; 8] = [0; 8];

fn word(bytes: &[u8], k: usize) -> u64 {
    bytes[8 * k..]
        .first_chunk()
        .map_or(0, |word| u64::from_le_bytes(*word))
}

fn put(bytes: &mut [u8], k: usize, word: u64) {
    bytes[8 * k..8 * k + 8].copy_from_slice(&word.to_le_bytes());
}

/// Whether a slot's first word is the check word of the rest. Never zero, so that an empty slot is not sound.
fn sound(slot: &[u8]) -> bool {
    word(slot, 0) == check_word(&slot[8..])
}

fn check_word(bytes: &[u8]) -> u64 {
    1 << 32 | u64::from(crc32fast::hash(bytes))
}

fn pose_words(pose: &Isometry2<f64>) -> [u64; 4] {
    [
        pose.translation.x,
        pose.translation.y,
        pose.rotation.re,
        pose.rotation.im,
    ]
    .map(f64::to_bits)
}

/// Bit for bit, without making the rotation's length one again.
fn pose_of(words: &[u64]) -> Isometry2<f64> {
    let [x, y, re, im] = [0, 1, 2, 3].map(|k| f64::from_bits(words[k]));
    Isometry2::from_parts(
        Translation2::new(x, y),
        UnitComplex::new_unchecked(Complex::new(re, im)),
    )
}

fn memory_words(memory: &TrackerState) -> [u64; MEMORY_WORDS] {
    let mut words = [0; MEMORY_WORDS];
    words[..4].copy_from_slice(&pose_words(&memory.pose));
    for (k, anchor) in memory.anchors.iter().enumerate() {
        let words = &mut words[4 + k * ANCHOR_WORDS..][..ANCHOR_WORDS];
        if let Some(anchor) = anchor {
            words[0] = 1;
            words[1..5].copy_from_slice(&pose_words(&anchor.pose));
            let twist = anchor.twist;
            words[5..].copy_from_slice(
                &[
                    twist.vx_mps,
                    twist.vy_mps,
                    twist.yaw_rate_radps,
                    anchor.age_s,
                ]
                .map(f64::to_bits),
            );
        }
    }
    let rest = [
        memory.mean_overlap.to_bits(),
        memory.mean_weight.to_bits(),
        memory.doubtful.into(),
        memory.unmatched.into(),
    ];
    words[4 + 2 * ANCHOR_WORDS..].copy_from_slice(&rest);
    words
}

fn memory_of(words: &[u64; MEMORY_WORDS]) -> TrackerState {
    let anchor = |k: usize| {
        let words = &words[4 + k * ANCHOR_WORDS..][..ANCHOR_WORDS];
        let [vx_mps, vy_mps, yaw_rate_radps, age_s] =
            [5, 6, 7, 8].map(|k| f64::from_bits(words[k]));
        (words[0] == 1).then(|| Anchor {
            pose: pose_of(&words[1..5]),
            twist: Twist {
                vx_mps,
                vy_mps,
                yaw_rate_radps,
            },
            age_s,
        })
    };
    let rest = &words[4 + 2 * ANCHOR_WORDS..];
    TrackerState {
        pose: pose_of(words),
        anchors: [anchor(0), anchor(1)],
        mean_overlap: f64::from_bits(rest[0]),
        mean_weight: f64::from_bits(rest[1]),
        doubtful: rest[2] as u32,
        unmatched: rest[3] as u32,
    }
}

fn encode_state(head: [u64; 3], memory: &TrackerState) -> [u8; STATE_BYTES] {
    let mut slot = [0; STATE_BYTES];
    head.into_iter()
        .chain(memory_words(memory))
        .enumerate()
        .for_each(|(k, value)| put(&mut slot, k + 1, value));
    let check = check_word(&slot[8..]);
    put(&mut slot, 0, check);
    slot
}

fn decode_state(slot: &[u8; STATE_BYTES]) -> Option<([u64; 3], TrackerState)> {
    let memory = std::array::from_fn(|k| word(slot, k + 4));
    sound(slot).then(|| ([1, 2, 3].map(|k| word(slot, k)), memory_of(&memory)))
}

fn encode_keyframe(keyframe: &Keyframe, slot: &mut [u8]) {
    put(slot, 1, keyframe.id);
    pose_words(&keyframe.pose)
        .into_iter()
        .enumerate()
        .for_each(|(k, value)| put(slot, k + 2, value));
    let mut at = KEYFRAME_WORDS * 8;
    for (level, (corner, cells)) in keyframe.images().into_iter().enumerate() {
        corner
            .iter()
            .enumerate()
            .for_each(|(k, value)| put(slot, 6 + 2 * level + k, *value as u64));
        slot[at..]
            .iter_mut()
            .zip(cells)
            .for_each(|(to, cell)| *to = *cell);
        at += cells.len();
    }
    let check = check_word(&slot[8..]);
    put(slot, 0, check);
}

/// Whether the slot was sound.
fn decode_keyframe(slot: &[u8], keyframe: &mut Keyframe) -> bool {
    keyframe.id = word(slot, 1);
    keyframe.pose = pose_of(&std::array::from_fn::<u64, 4, _>(|k| word(slot, k + 2)));
    let mut at = KEYFRAME_WORDS * 8;
    for (level, (corner, cells)) in keyframe.images_mut().into_iter().enumerate() {
        *corner = [0, 1].map(|k| word(slot, 6 + 2 * level + k) as i64);
        let count = cells.len();
        cells
            .into_iter()
            .zip(&slot[at..])
            .for_each(|(cell, from)| *cell = *from);
        at += count;
    }
    sound(slot)
}
