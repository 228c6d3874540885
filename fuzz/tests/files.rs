//! Gyre's own files, which another version, a bad disk or another program may have changed: the
//! journal, the refinement's map and the log of keyframes.

use std::{fs, path::Path};

use bolero::{TypeGenerator, check};
use gyre_contract::{Item, PoseHeader};
use gyre_fuzz::{
    Failure, Target,
    edit::{ByteEdit, Number, edit_bytes},
};
use gyre_geometry::{Pose, SparsePoint, UncertainMotion, samples::SensorConfigs};
use gyre_journal::{
    self as journal, Journal,
    checkpoint::{self, Checkpoint},
};
use gyre_matching::{RefinementConfig, Refiner, Searched};
use gyre_slam::{Keyframe, RecordLog, RecordReader, records_path};

use crate::recordings::folder;

const MAGIC: usize = 16;
const HEADER: usize = 20;
const RECORD: usize = HEADER + size_of::<PoseHeader>();

/// An edit of a file of records with checksums.
#[derive(Clone, Debug, TypeGenerator)]
enum Edit {
    Bytes(ByteEdit),
    /// A word of a record, whose checksum is mended.
    Word(u8, u16, Number),
}

/// Edits a file; `word` changes a word, and mends the checksums.
fn edited(file: &[u8], edits: &[Edit], word: impl Fn(&mut [u8], usize, usize, u64)) -> Vec<u8> {
    let mut bytes = file.to_vec();
    for edit in edits {
        match edit {
            Edit::Bytes(edit) => edit_bytes(&mut bytes, std::slice::from_ref(edit)),
            Edit::Word(index, at, number) => {
                let (index, at) = (usize::from(*index), usize::from(*at));
                word(&mut bytes, index, at, number.bits());
            }
        }
    }
    bytes
}

fn pose(seq: u64) -> PoseHeader {
    PoseHeader {
        item: Item::numbered(seq),
        ..PoseHeader::default()
    }
}

/// Checks a journal, cuts its torn end, and continues.
fn use_journal(out: &Path) -> Result<(), Failure> {
    let content = journal::check(out)?;
    if content.torn > 0 {
        journal::cut(out, content.poses + u64::from(content.ended))?;
    }
    let mut journal = Journal::open(out)?;
    let (last, ended) = journal.last(3)?;
    assert_eq!(ended, content.ended);
    assert_eq!(last.len() as u64, content.poses.min(3));
    if !ended {
        journal.append(&pose(content.poses))?;
        drop(journal);
        assert_eq!(journal::check(out)?.poses, content.poses + 1);
    }
    for pose in journal::poses(out)? {
        pose?;
    }
    Ok(())
}

#[test]
fn journals() {
    let (target, folder) = (Target::new(16), folder());
    let file = journal::path(folder.path());
    let mut journal = Journal::open(folder.path()).unwrap();
    (0..4).for_each(|seq| journal.append(&pose(seq)).unwrap());
    drop(journal);
    let valid = fs::read(&file).unwrap();
    assert_eq!(valid.len(), MAGIC + 4 * RECORD);
    use_journal(folder.path()).unwrap();
    let word = |bytes: &mut [u8], index: usize, at: usize, number: u64| {
        let records = bytes.get_mut(MAGIC..).unwrap_or_default();
        if let Some(record) = records.chunks_exact_mut(RECORD).nth(index % 5) {
            change(record, at, number);
        }
    };
    check!().with_type::<Vec<Edit>>().for_each(|edits| {
        fs::write(&file, edited(&valid, edits, word)).unwrap();
        target.run(|| use_journal(folder.path()));
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

/// Restores the state after the last item, and refines one more.
fn use_map(file: &Path) -> Result<(), Failure> {
    let mut refiner = Refiner::new(&config(), &SensorConfigs::default(), POINTS)?;
    let cells = refiner.keyframe_cells();
    let mut checkpoint = Checkpoint::open(file, 4, config().keyframes, cells)?;
    checkpoint.newest_known(&[pose(3), pose(2)])?;
    checkpoint.restore(3, &mut refiner)?;
    let points = points();
    refiner.refine(&Searched::by_radar(
        4,
        &points,
        &points,
        &Pose::translation(2.0, 0.0),
        0.25,
    ));
    Ok(checkpoint.write(4, 0, &refiner)?)
}

#[test]
fn refinement_maps() {
    let (target, folder) = (Target::new(96), folder());
    let file = checkpoint::path(folder.path());
    let mut drive = Refiner::new(&config(), &SensorConfigs::default(), POINTS).unwrap();
    let cells = drive.keyframe_cells();
    let mut checkpoint = Checkpoint::open(&file, 4, config().keyframes, cells).unwrap();
    let (points, motion) = (points(), Pose::translation(2.0, 0.0));
    for item in 0..4 {
        drive.refine(&Searched::by_radar(item, &points, &points, &motion, 0.25));
        checkpoint.write(item, 0, &drive).unwrap();
    }
    drop(checkpoint);
    let valid = fs::read(&file).unwrap();
    let slots = slots(&valid);
    use_map(&file).unwrap();
    let word = |bytes: &mut [u8], index: usize, at: usize, number: u64| {
        let slot = slots[index % slots.len()].clone();
        let slot = bytes.get_mut(slot).unwrap_or_default();
        let words = slot.len() / 8;
        if words > 1 {
            // The first words matter most; the others are cells.
            let at = 8 * (1 + at % (words - 1).min(60));
            slot[at..at + 8].copy_from_slice(&number.to_le_bytes());
            let checksum = 1 << 32 | u64::from(crc32fast::hash(&slot[8..]));
            slot[..8].copy_from_slice(&checksum.to_le_bytes());
        }
    };
    check!().with_type::<Vec<Edit>>().for_each(|edits| {
        fs::write(&file, edited(&valid, edits, word)).unwrap();
        target.run(|| use_map(&file));
    });
}

/// The slots that hold something. The file's header has, after 16 bytes, the numbers of slots of
/// states and of keyframes, and the bytes of each.
fn slots(file: &[u8]) -> Vec<std::ops::Range<usize>> {
    let number =
        |k: usize| u64::from_le_bytes(file[MAGIC + 8 * k..][..8].try_into().unwrap()) as usize;
    let [states, keyframes, state, keyframe] = [0, 1, 2, 3].map(number);
    let header = MAGIC + 4 * 8;
    let state_slots = (0..states).map(|k| header + k * state..header + (k + 1) * state);
    let first = header + states * state;
    let keyframe_slots = (0..keyframes).map(|k| first + k * keyframe..first + (k + 1) * keyframe);
    let is_filled = |slot: &std::ops::Range<usize>| {
        slot.end <= file.len() && file[slot.start..slot.start + 8] != [0; 8]
    };
    let slots: Vec<_> = state_slots
        .chain(keyframe_slots)
        .filter(is_filled)
        .collect();
    let of_states = slots.iter().filter(|slot| slot.start < first).count();
    assert!(of_states == 4 && slots.len() > 4, "{slots:?}");
    slots
}

const KEYFRAMES: usize = 4;

fn keyframe(seq: usize) -> Keyframe {
    let points = vec![SparsePoint::default(); 4];
    Keyframe::standing(seq as u64, UncertainMotion::identity(), points)
}

/// Reads all keyframes, cuts the torn end, and continues.
fn use_log(out: &Path) -> Result<(), Failure> {
    let mut reader = RecordReader::open(out)?;
    let found = reader.len();
    let read: Result<Vec<Keyframe>, _> = (0..found).map(|index| reader.read(index)).collect();
    let mut log = RecordLog::open(out)?;
    assert_eq!(log.len(), found);
    log.cut(found)?;
    log.append(&keyframe(found))?;
    assert_eq!(reader.refresh()?, found + 1);
    assert_eq!(reader.read(found)?, keyframe(found));
    read?;
    Ok(())
}

/// Changes a word of a record or of its header, and mends their checksums.
fn change(record: &mut [u8], at: usize, number: u64) {
    let (header, content) = record.split_at_mut(HEADER);
    let places = MAGIC + content.len() - 8;
    match at % places {
        at if at < 8 => header[at..at + 8].copy_from_slice(&number.to_le_bytes()),
        at => {
            let at = (at - 8).min(content.len() - 8);
            content[at..at + 8].copy_from_slice(&number.to_le_bytes());
            header[12..16].copy_from_slice(&crc32fast::hash(content).to_le_bytes());
        }
    }
    let check = crc32fast::hash(&header[..16]);
    header[16..].copy_from_slice(&check.to_le_bytes());
}

#[test]
fn keyframe_logs() {
    let (target, folder) = (Target::new(16), folder());
    let path = records_path::<Keyframe>(folder.path());
    let mut log = RecordLog::open(folder.path()).unwrap();
    (0..KEYFRAMES).for_each(|seq| log.append(&keyframe(seq)).unwrap());
    log.end().unwrap();
    drop(log);
    let valid = fs::read(&path).unwrap();
    let record = (valid.len() - MAGIC - HEADER) / KEYFRAMES;
    use_log(folder.path()).unwrap();
    let word = |bytes: &mut [u8], index: usize, at: usize, number: u64| {
        let records = bytes.get_mut(MAGIC..).unwrap_or_default();
        let record = records.chunks_exact_mut(record).nth(index % KEYFRAMES);
        record
            .map(|record| change(record, at, number))
            .unwrap_or_default();
    };
    check!().with_type::<Vec<Edit>>().for_each(|edits| {
        fs::write(&path, edited(&valid, edits, word)).unwrap();
        target.run(|| use_log(folder.path()));
    });
}
