//! Gyre's own files, which another version, a bad disk or another program may have changed: the journal and the refinement's map.

use std::fs;

use bolero::check;
use gyre_fuzz::{
    Failure, Target,
    edit::{ByteEdit, Number, edit_bytes},
};
use gyre_geometry::{Pose, SparsePoint};
use gyre_messages::{Item, PoseHeader};
use gyre_pose_integration::journal::{self, Journal};
use gyre_refinement::checkpoint::{self, Checkpoint};
use gyre_scan_matching::{RefinementConfig, Refiner};

use crate::recordings::folder;

const JOURNAL_MAGIC: usize = 16;
const RECORD: usize = size_of::<PoseHeader>() + 8;

#[test]
fn journals() {
    let (target, folder) = (Target::new("journals", 16), folder());
    let file = journal::path(folder.path());
    let (mut journal, _) = Journal::open(&file).unwrap();
    for seq in 0..4 {
        let item = Item {
            seq,
            ..Item::default()
        };
        let pose = PoseHeader {
            item,
            ..PoseHeader::default()
        };
        journal.append(&pose).unwrap();
    }
    drop(journal);
    let valid = fs::read(&file).unwrap();
    check!()
        .with_type::<(bool, Vec<ByteEdit>)>()
        .for_each(|(checked, edits)| {
            let mut bytes = valid.clone();
            edit_bytes(&mut bytes, edits);
            if *checked {
                let records = bytes.get_mut(JOURNAL_MAGIC..).unwrap_or_default();
                for record in records.chunks_exact_mut(RECORD) {
                    let (pose, check) = record.split_at_mut(RECORD - 8);
                    check.copy_from_slice(&u64::from(crc32fast::hash(pose)).to_le_bytes());
                }
            }
            fs::write(&file, bytes).unwrap();
            target.run(|| -> Result<(), Failure> {
                let read = journal::read(&file)?.len();
                let (mut journal, records) = Journal::open(&file)?;
                assert_eq!(read, records.len());
                journal.append(&PoseHeader::default())?;
                assert_eq!(journal::read(&file)?.len(), read + 1);
                Ok(())
            });
        });
}

const POINTS: usize = 40;

fn config() -> RefinementConfig {
    RefinementConfig {
        keyframes: 3,
        ..RefinementConfig::default()
    }
}

fn points() -> Vec<SparsePoint> {
    let point = |k: usize| SparsePoint {
        x_m: 3.0 + (k * 7 % 40) as f32,
        y_m: (k * 13 % 60) as f32 - 30.0,
        weight: 1.0,
        ..SparsePoint::default()
    };
    (0..POINTS).map(point).collect()
}

#[test]
fn refinement_maps() {
    let (target, folder) = (Target::new("refinement_maps", 96), folder());
    let file = checkpoint::path(folder.path());
    let refiner = || Refiner::new(&config(), POINTS).unwrap();
    let mut drive = refiner();
    let open = |cells| Checkpoint::open(&file, 4, config().keyframes, cells);
    let cells = drive.keyframe_cells();
    let (mut checkpoint, points) = (open(cells).unwrap(), points());
    let motion = Pose::translation(2.0, 0.0);
    for item in 0..4 {
        drive.refine(item, &points, &points, &motion, 0.25);
        checkpoint.write(item, &drive).unwrap();
    }
    drop(checkpoint);
    let valid = fs::read(&file).unwrap();
    let slot = 80 + cells;
    let states = valid.len() - slot * ((valid.len() - 20_000) / slot);
    check!()
        .with_type::<(Vec<ByteEdit>, Vec<(u16, u8, Number)>)>()
        .for_each(|(edits, words)| {
            let mut bytes = valid.clone();
            edit_bytes(&mut bytes, edits);
            words.iter().for_each(|(at, word, number)| {
                edit_slot(&mut bytes, usize::from(*at), *word, *number)
            });
            fs::write(&file, bytes).unwrap();
            target.run(|| -> Result<(), Failure> {
                let mut restored = refiner();
                let mut checkpoint = open(restored.keyframe_cells())?;
                checkpoint.restore(3, &mut restored)?;
                restored.refine(4, &points, &points, &motion, 0.25);
                Ok(checkpoint.write(4, &restored)?)
            });
        });
    assert!(states < valid.len());
}

/// Changes a word of a slot and mends its checksum: the map's layout is a header of 40 bytes, slots of states of 30 words each, then
/// slots of keyframes.
fn edit_slot(bytes: &mut [u8], state: usize, word: u8, number: Number) {
    const STATE: usize = 30 * 8;
    let start = 40 + state % 8 * STATE;
    let Some(slot) = bytes.get_mut(start..start + STATE) else {
        return;
    };
    let at = 8 + usize::from(word) % 29 * 8;
    slot[at..at + 8].copy_from_slice(&number.bits().to_le_bytes());
    let checksum = 1 << 32 | u64::from(crc32fast::hash(&slot[8..]));
    slot[..8].copy_from_slice(&checksum.to_le_bytes());
}
