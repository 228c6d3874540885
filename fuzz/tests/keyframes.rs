//! The log of keyframes, which another version, a bad disk or another program may have changed.

use std::{fs, path::Path};

use bolero::check;
use gyre_fuzz::{Failure, Target};
use gyre_geometry::{SparsePoint, Twist, UncertainMotion};
use gyre_slam::{Keyframe, RecordLog, RecordReader, records_path};

use crate::{
    files::{Edit, edited},
    recordings::folder,
};

const KEYFRAMES: usize = 4;
const MAGIC: usize = 16;
/// The header of a record: its number, its length, and the checksums of its bytes and of the
/// header.
const HEADER: usize = 20;

fn keyframe(seq: usize) -> Keyframe {
    Keyframe {
        seq: seq as u64,
        scan: seq as u64,
        stamp_ns: 0,
        pose: UncertainMotion::identity(),
        motion: UncertainMotion::identity(),
        noise: UncertainMotion::identity().covariance,
        twist: Twist::default(),
        path_m: 0.0,
        points: vec![SparsePoint::default(); 4],
    }
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
pub fn change(record: &mut [u8], at: usize, number: u64) {
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
