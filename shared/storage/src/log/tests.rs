use std::{fs, thread};

use super::*;
use crate::GroupSync;

const MAGIC: LogMagic = *b"a test's log v1\n";
const KIND: LogKind = LogKind {
    magic: MAGIC,
    length: None,
};
/// Records of one length.
const EQUAL: LogKind = LogKind {
    magic: *b"gyre equal 1   \n",
    length: Some(EACH),
};
const EACH: usize = 30;
const LIMIT: usize = GroupSync::LIMIT as usize;

/// A record whose length depends on its number.
fn record(index: usize) -> Vec<u8> {
    vec![index as u8; index % 40]
}

/// A log of so many records, and its folder.
fn log_of(records: usize) -> (tempfile::TempDir, PathBuf) {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("test.log");
    let mut log = Log::open(&path, KIND).unwrap();
    (0..records).for_each(|index| log.append(&record(index)).unwrap());
    (folder, path)
}

fn require_records(path: &Path, expected: usize) {
    let reader = LogReader::open(path, KIND).unwrap();
    assert_eq!(reader.len(), expected);
    let mut bytes = Vec::new();
    for index in 0..expected {
        reader.read(index, &mut bytes).unwrap();
        assert_eq!(bytes, record(index), "record {index}");
    }
}

/// Returns the offset of a record, from the lengths of those before it.
fn offset(index: usize) -> usize {
    let bytes = |index| 20 + record(index).len().next_multiple_of(4);
    MAGIC.len() + (0..index).map(bytes).sum::<usize>()
}

/// Changes a byte, counted from the start of a record.
fn corrupt(path: &Path, index: usize, byte: usize) {
    let mut bytes = fs::read(path).unwrap();
    bytes[offset(index) + byte] ^= 1;
    fs::write(path, bytes).unwrap();
}

#[test]
fn an_incomplete_record_at_the_end_is_not_seen_and_cut_off_whatever_its_length() {
    let (_folder, path) = log_of(4);
    let complete = fs::read(&path).unwrap();
    for length in 0..complete.len() {
        fs::write(&path, &complete[..length]).unwrap();
        let expected = (0..4).filter(|k| offset(k + 1) <= length).count();
        require_records(&path, expected);
        let mut log = Log::open(&path, KIND).unwrap();
        assert_eq!(log.len(), expected, "{length} bytes");
        (expected..4).for_each(|index| log.append(&record(index)).unwrap());
        assert_eq!(fs::read(&path).unwrap(), complete, "{length} bytes");
    }
}

#[test]
fn what_a_power_failure_leaves_of_the_last_records_is_cut_off() {
    let (_folder, path) = log_of(3 * LIMIT);
    let complete = fs::read(&path).unwrap();
    let first = 3 * LIMIT - LIMIT - 1;
    for damaged in [first, first + 1, first + 9, 3 * LIMIT - 1] {
        for byte in [0, 19, 20 + record(damaged).len().saturating_sub(1)] {
            fs::write(&path, &complete).unwrap();
            corrupt(&path, damaged, byte);
            require_records(&path, damaged);
            assert_eq!(Log::open(&path, KIND).unwrap().len(), damaged);
            assert_eq!(fs::read(&path).unwrap(), complete[..offset(damaged)]);
        }
    }
}

#[test]
fn zeros_in_place_of_the_start_are_cut_off_if_they_can_be_of_a_power_failure() {
    let cases = [
        (LIMIT, 100, None),
        (LIMIT, MAGIC.len(), None),
        (2 * LIMIT, 100, Some(0)),
    ];
    for (records, zeros, expected) in cases {
        let (_folder, path) = log_of(records);
        let mut bytes = fs::read(&path).unwrap();
        bytes[..zeros].fill(0);
        fs::write(&path, bytes).unwrap();
        match (Log::open(&path, KIND), expected) {
            (Ok(log), None) => assert!(log.is_empty()),
            (Err(LogError::Damaged { record, .. }), Some(expected)) => assert_eq!(record, expected),
            other => panic!("{other:?}"),
        }
    }
}

#[test]
fn a_damaged_record_in_the_middle_is_refused_with_its_number() {
    let (_folder, path) = log_of(3 * LIMIT);
    let complete = fs::read(&path).unwrap();
    for damaged in [0, 7, 2 * LIMIT - 2] {
        // Its header: the records behind it cannot be found in order.
        corrupt(&path, damaged, 3);
        let corrupted = fs::read(&path).unwrap();
        let errors = [
            Log::open(&path, KIND).unwrap_err(),
            LogReader::open(&path, KIND).unwrap_err(),
        ];
        for error in errors {
            assert!(
                matches!(&error, LogError::Damaged { record, .. } if *record == damaged),
                "{error}"
            );
        }
        assert_eq!(fs::read(&path).unwrap(), corrupted);
        fs::write(&path, &complete).unwrap();
    }
    // Its bytes: found when it is read.
    corrupt(&path, 7, 21);
    let reader = LogReader::open(&path, KIND).unwrap();
    let error = reader.read(7, &mut Vec::new()).unwrap_err();
    assert!(error.to_string().contains("damaged at record 7"), "{error}");
    reader.read(8, &mut Vec::new()).unwrap();
}

#[test]
fn the_start_of_a_record_is_read_as_it_was_written() {
    let (_folder, path) = log_of(50);
    let reader = LogReader::open(&path, KIND).unwrap();
    let mut bytes = Vec::new();
    for (index, length) in [(0, 8), (7, 0), (7, 5), (7, 7), (39, 12), (39, 1000)] {
        reader.read_start(index, length, &mut bytes).unwrap();
        assert_eq!(bytes, record(index)[..length.min(index % 40)]);
    }
    corrupt(&path, 7, 3);
    let error = reader.read_start(7, 5, &mut bytes).unwrap_err();
    assert!(error.to_string().contains("damaged at record 7"), "{error}");
}

#[test]
fn a_reader_sees_records_while_they_are_appended_and_cut_off() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("test.log");
    let mut reader = LogReader::open(&path, KIND).unwrap();
    assert_eq!(reader.refresh().unwrap(), 0);
    let of_writer = path.clone();
    let writer = thread::spawn(move || {
        let mut log = Log::open(&of_writer, KIND).unwrap();
        (0..2000).for_each(|index| log.append(&record(index)).unwrap());
        log
    });
    let (mut seen, mut bytes) = (0, Vec::new());
    while seen < 2000 {
        let ended = writer.is_finished();
        for index in seen..reader.refresh().unwrap() {
            reader.read(index, &mut bytes).unwrap();
            assert_eq!(bytes, record(index));
        }
        seen = reader.len();
        assert!(!ended || seen == 2000);
    }
    let mut log = writer.join().unwrap();
    log.cut(10).unwrap();
    assert_eq!((log.len(), reader.refresh().unwrap()), (10, 10));
    log.append(&record(10)).unwrap();
    require_records(&path, 11);
    assert_eq!((reader.refresh().unwrap(), reader.unchanged()), (11, 10));
    // Others of the same lengths are not taken for those that were cut off.
    log.cut(8).unwrap();
    (8..12).for_each(|index| log.append(&vec![99; index]).unwrap());
    assert_eq!((reader.refresh().unwrap(), reader.unchanged()), (12, 8));
    reader.read(9, &mut bytes).unwrap();
    assert_eq!(bytes, [99; 9]);
    log.cut(0).unwrap();
    assert_eq!(fs::read(&path).unwrap(), MAGIC);
}

#[test]
fn another_programs_file_is_refused_and_left_as_it_is() {
    let (_folder, path) = log_of(2);
    let other = LogKind {
        magic: *b"a test's log v2\n",
        length: None,
    };
    let other = Log::open(&path, other);
    assert!(matches!(other, Err(LogError::Foreign { .. })));
    require_records(&path, 2);
    for theirs in [&b"something else altogether"[..], b"theirs"] {
        fs::write(&path, theirs).unwrap();
        assert!(matches!(
            Log::open(&path, KIND),
            Err(LogError::Foreign { .. })
        ));
        assert!(matches!(
            LogReader::open(&path, KIND),
            Err(LogError::Foreign { .. })
        ));
        assert_eq!(fs::read(&path).unwrap(), theirs);
    }
}

#[test]
fn changes_that_rely_on_a_record_are_as_few_as_the_records_in_danger() {
    let (_folder, path) = log_of(0);
    let mut log = Log::open(&path, KIND).unwrap();
    log.append(&record(1)).unwrap();
    for _ in 0..10 * LIMIT {
        log.rely().unwrap();
        let safe = log.file.sync.safe().unwrap_or(0);
        assert!(log.changes - safe <= GroupSync::LIMIT);
    }
    // The record is safe, and nothing more is counted.
    assert!(log.changes <= 2 * GroupSync::LIMIT);
}

#[test]
fn a_record_of_an_impossible_length_is_not_read() {
    let (_folder, path) = log_of(3);
    let mut header = fs::read(&path).unwrap()[offset(2)..offset(2) + 20].to_vec();
    header[0] = 3;
    header[8..12].copy_from_slice(&u32::MAX.to_le_bytes());
    let check = crc32fast::hash(&header[..16]).to_le_bytes();
    header[16..].copy_from_slice(&check);
    let mut bytes = fs::read(&path).unwrap();
    bytes.extend(header);
    fs::write(&path, bytes).unwrap();
    let file = fs::OpenOptions::new().write(true).open(&path).unwrap();
    // As long as the record states, and longer than a power failure can leave.
    file.set_len(1 << 33).unwrap();
    let error = LogReader::open(&path, KIND).unwrap_err();
    assert!(
        matches!(error, LogError::Damaged { record: 3, .. }),
        "{error}"
    );
}

#[test]
fn a_record_that_no_reader_would_take_is_not_appended() {
    let (_folder, path) = log_of(1);
    let mut log = Log::open(&path, KIND).unwrap();
    assert!(log.append(&vec![0; MAX_BYTES + 1]).is_err());
    log.append(&[0; 5]).unwrap();
    assert_eq!(LogReader::open(&path, KIND).unwrap().len(), 2);
}

/// A log of so many records of one length, and its folder.
fn equal_log_of(records: usize) -> (tempfile::TempDir, PathBuf) {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("equal.log");
    let mut log = Log::open(&path, EQUAL).unwrap();
    (0..records).for_each(|index| log.append(&[index as u8; EACH]).unwrap());
    (folder, path)
}

/// The same, of records that were in danger when later ones were written: the power has failed
/// early.
fn equal_log_in_danger(records: usize) -> (tempfile::TempDir, PathBuf) {
    let (folder, path) = equal_log_of(0);
    let (mut bytes, mut record) = (EQUAL.magic.to_vec(), Vec::new());
    for index in 0..records {
        encode(index, 1 + index as u32, &[index as u8; EACH], &mut record);
        bytes.extend_from_slice(&record);
    }
    fs::write(&path, bytes).unwrap();
    (folder, path)
}

fn corrupt_equal(path: &Path, index: usize) {
    let mut bytes = fs::read(path).unwrap();
    bytes[16 + index * 52 + 30] ^= 1;
    fs::write(path, bytes).unwrap();
}

#[test]
fn records_of_one_length_are_found_by_their_numbers() {
    let (_folder, path) = equal_log_of(200);
    let mut reader = LogReader::open(&path, EQUAL).unwrap();
    let mut log = Log::open(&path, EQUAL).unwrap();
    assert_eq!((reader.len(), log.len()), (200, 200));
    let mut bytes = Vec::new();
    for index in [0, 70, 199] {
        reader.read(index, &mut bytes).unwrap();
        assert_eq!(bytes, [index as u8; EACH]);
    }
    log.append(&[200; EACH]).unwrap();
    assert_eq!((reader.refresh().unwrap(), reader.unchanged()), (201, 200));
    log.cut(190).unwrap();
    (190..205).for_each(|_| log.append(&[7; EACH]).unwrap());
    assert_eq!((reader.refresh().unwrap(), reader.unchanged()), (205, 0));
    reader.read(190, &mut bytes).unwrap();
    assert_eq!(bytes, [7; EACH]);
    // Only the end is read.
    corrupt_equal(&path, 100);
    assert_eq!(
        Log::open(&path, EQUAL).unwrap_err().to_string(),
        Busy { path: path.clone() }.to_string()
    );
    drop(log);
    assert_eq!(Log::open(&path, EQUAL).unwrap().len(), 205);
    let damaged = reader.read(100, &mut bytes).unwrap_err().to_string();
    assert!(damaged.contains("damaged at record 100"), "{damaged}");
}

#[test]
fn an_incomplete_record_of_one_length_is_cut_off_whatever_its_length() {
    let (_folder, path) = equal_log_of(2);
    let complete = fs::read(&path).unwrap();
    for length in 0..complete.len() {
        fs::write(&path, &complete[..length]).unwrap();
        let expected = length.saturating_sub(MAGIC.len()) / 52;
        let mut reader = LogReader::open(&path, EQUAL).unwrap();
        assert_eq!((reader.len(), reader.torn()), (expected, 0));
        let mut log = Log::open(&path, EQUAL).unwrap();
        log.append(&[9; EACH]).unwrap();
        let found = (reader.refresh().unwrap(), reader.unchanged());
        assert_eq!(found, (expected + 1, expected), "{length} bytes");
    }
}

#[test]
fn records_in_danger_are_cut_off_and_records_that_were_safe_are_refused() {
    for damaged in 0..6 {
        let (_folder, path) = equal_log_in_danger(6);
        corrupt_equal(&path, damaged);
        let reader = LogReader::open(&path, EQUAL).unwrap();
        assert_eq!((reader.len(), reader.torn()), (damaged, 6 - damaged));
        let mut log = Log::open(&path, EQUAL).unwrap();
        log.append(&[9; EACH]).unwrap();
        assert_eq!(log.len(), damaged + 1);
    }
    // Safe by now: the records after them say so.
    for damaged in [0, 1] {
        let (_folder, path) = equal_log_of(3);
        let mut log = Log::open(&path, EQUAL).unwrap();
        log.append(&[3; EACH]).unwrap();
        drop(log);
        corrupt_equal(&path, damaged);
        let corrupted = fs::read(&path).unwrap();
        for error in [
            LogReader::open(&path, EQUAL).unwrap_err(),
            Log::open(&path, EQUAL).unwrap_err(),
        ] {
            let error = error.to_string();
            let expected = format!("damaged at record {damaged},");
            assert!(error.contains(&expected), "{error}");
        }
        assert_eq!(fs::read(&path).unwrap(), corrupted);
    }
}

#[test]
fn zeros_in_place_of_the_first_page_of_records_in_danger_are_cut_off() {
    let (_folder, path) = equal_log_in_danger(20);
    let mut bytes = fs::read(&path).unwrap();
    bytes[..512].fill(0);
    fs::write(&path, bytes).unwrap();
    let reader = LogReader::open(&path, EQUAL).unwrap();
    assert_eq!((reader.len(), reader.torn()), (0, 20));
}

#[test]
fn a_record_of_one_length_in_a_wrong_place_is_not_valid() {
    let (_folder, path) = equal_log_in_danger(4);
    let mut bytes = fs::read(&path).unwrap();
    bytes.copy_within(16 + 52..16 + 2 * 52, 16 + 2 * 52);
    fs::write(&path, bytes).unwrap();
    assert_eq!(LogReader::open(&path, EQUAL).unwrap().len(), 2);
}

#[test]
fn a_file_that_was_extended_far_is_refused() {
    let (_folder, path) = equal_log_of(3);
    let file = fs::OpenOptions::new().write(true).open(&path).unwrap();
    file.set_len(1 << 40).unwrap();
    let error = LogReader::open(&path, EQUAL).unwrap_err();
    assert!(matches!(error, LogError::Damaged { .. }), "{error}");
}

#[test]
fn the_file_of_another_version_is_told_from_one_of_another_program() {
    let (_folder, path) = equal_log_of(2);
    let mut bytes = fs::read(&path).unwrap();
    bytes[..16].copy_from_slice(b"gyre equal 0   \n");
    fs::write(&path, bytes).unwrap();
    let error = Log::open(&path, EQUAL).unwrap_err();
    assert!(matches!(error, LogError::OtherVersion { .. }), "{error}");
}
