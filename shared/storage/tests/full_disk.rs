//! A disk that is full for a while: the limit of the size of a file stands for it. One test,
//! because the limit and the state of the disk are those of the process.

#![allow(clippy::unwrap_used)]

use std::sync::{Arc, atomic::AtomicBool};

use gyre_storage::{
    Disk, LogMagic, Record, RecordLog, RecordReader, continue_when_full, disk, has_room,
    records_path, was_full,
};
use rustix::process::{Resource, Rlimit, getrlimit, setrlimit};
use signal_hook::{consts::SIGXFSZ, flag::register};
use tempfile::TempDir;

#[derive(Debug, PartialEq)]
struct Bytes(Vec<u8>);

impl Record for Bytes {
    const FILE: &'static str = "bytes.log";
    const MAGIC: LogMagic = *b"gyre bytes 1    ";

    fn encode(&self, bytes: &mut Vec<u8>) {
        bytes.extend(&self.0);
    }

    fn decode(bytes: &[u8]) -> Option<Self> {
        Some(Self(bytes.to_vec()))
    }
}

fn limit(bytes: Option<u64>) {
    let limit = Rlimit {
        current: bytes,
        ..getrlimit(Resource::Fsize)
    };
    setrlimit(Resource::Fsize, limit).unwrap();
}

fn numbers(out: &TempDir) -> Vec<u8> {
    let reader = RecordReader::<Bytes>::open(out.path()).unwrap();
    reader.from(0).map(|record| record.unwrap().0[0]).collect()
}

#[test]
fn writes_to_a_full_disk_are_made_in_their_order_when_there_is_room_again() {
    // Otherwise the signal of the limit would end the process.
    register(SIGXFSZ, Arc::new(AtomicBool::new(false))).unwrap();
    let out = TempDir::new().unwrap();
    let mut log = RecordLog::open(out.path()).unwrap();
    let record = |number: u8, bytes| Bytes(vec![number; bytes]);
    log.append(&record(0, 100)).unwrap();
    limit(Some(250));
    assert!(log.append(&record(1, 400)).is_err() && was_full());
    continue_when_full();
    assert_eq!(disk(), Disk::HasRoom);
    // More than a power failure may take.
    (1..=100).for_each(|number| log.append(&record(number, 400)).unwrap());
    assert_eq!(disk(), Disk::IsFull);
    assert_eq!(numbers(&out), [0]);
    log.sync().unwrap();
    assert_eq!(numbers(&out), [0], "the limit is still there");
    assert!(!has_room(out.path()), "as with a quota");
    limit(None);
    assert!(has_room(out.path()));
    log.sync().unwrap();
    assert_eq!(disk(), Disk::HasRoom);
    let expected: Vec<u8> = (0..=100).collect();
    assert_eq!(numbers(&out), expected);

    let length = records_path::<Bytes>(out.path()).metadata().unwrap().len();
    limit(Some(length));
    log.append(&record(101, 400)).unwrap();
    log.cut(50).unwrap();
    log.append(&record(50, 400)).unwrap();
    log.sync().unwrap();
    let expected: Vec<u8> = (0..=50).collect();
    assert_eq!(numbers(&out), expected, "what waits is cut off too");
    (51..=100).for_each(|number| log.append(&record(number, 400)).unwrap());
    (101..=108).for_each(|number| log.append(&record(number, 10 << 20)).unwrap());
    assert_eq!(disk(), Disk::Lost(false), "memory has its limit too");
    limit(None);
    log.sync().unwrap();
    assert_eq!(disk(), Disk::Lost(true));
    log.append(&record(109, 400)).unwrap();
    let expected: Vec<u8> = (0..=106).collect();
    assert_eq!(numbers(&out), expected, "a log has no gaps");
}
