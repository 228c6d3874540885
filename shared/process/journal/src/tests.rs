use std::{fs, thread, time::Duration};

use gyre_contract::Item;
use gyre_storage::GroupSync;

use super::*;

fn pose(seq: u64) -> PoseHeader {
    PoseHeader {
        item: Item {
            seq,
            ..Item::default()
        },
        x_m: seq as f64,
        ..PoseHeader::default()
    }
}

fn seqs(poses: &[PoseHeader]) -> Vec<u64> {
    poses.iter().map(|pose| pose.item.seq).collect()
}

fn read(path: &Path) -> Vec<u64> {
    let poses: Result<Vec<_>, _> = records(path).unwrap().unwrap().collect();
    seqs(&poses.unwrap())
}

/// A journal of so many poses, and its folder.
fn journal_of(poses: u64) -> (tempfile::TempDir, PathBuf) {
    let folder = tempfile::tempdir().unwrap();
    let path = path(folder.path());
    let mut journal = Journal::open(&path).unwrap();
    (0..poses).for_each(|seq| journal.append(&pose(seq)).unwrap());
    (folder, path)
}

/// The same, of poses that were in danger when later ones were written: the power has failed early.
fn journal_in_danger(poses: u64) -> (tempfile::TempDir, PathBuf) {
    let (folder, path) = journal_of(0);
    let mut bytes = MAGIC.to_vec();
    for seq in 0..poses {
        let record = Record {
            pose: pose(seq),
            in_danger: seq as u32,
        };
        let mut buffer = [0; RECORD];
        record.encode(&mut buffer);
        bytes.extend(buffer);
    }
    fs::write(&path, bytes).unwrap();
    (folder, path)
}

fn corrupt(path: &Path, record: u64) {
    let mut bytes = fs::read(path).unwrap();
    bytes[RECORDS.offset(record) as usize + 100] ^= 1;
    fs::write(path, bytes).unwrap();
}

#[test]
fn a_journal_is_cut_when_nobody_writes_it_any_more() {
    let (_folder, path) = journal_of(5);
    let writer = Journal::open(&path).unwrap();
    let refused = cut(&path, 3).unwrap_err();
    assert!(matches!(refused, JournalError::Busy(_)), "{refused}");
    assert_eq!(read(&path), [0, 1, 2, 3, 4]);
    let dying = thread::spawn(move || {
        thread::sleep(Duration::from_millis(100));
        let mut writer = writer;
        writer.append(&pose(5)).unwrap();
    });
    cut(&path, 3).unwrap();
    dying.join().unwrap();
    assert_eq!(read(&path), [0, 1, 2]);
}

#[test]
fn appended_poses_are_read_back() {
    let (_folder, path) = journal_of(3);
    assert_eq!(read(&path), [0, 1, 2]);
    let mut journal = Journal::open(&path).unwrap();
    journal.append(&pose(3)).unwrap();
    assert_eq!(read(&path), [0, 1, 2, 3]);
    let (last, ended) = journal.last(2).unwrap();
    assert_eq!((seqs(&last), ended), (vec![2, 3], false));
    assert_eq!(journal.last(9).unwrap().0.len(), 4);
    let rest: Result<Vec<_>, _> = records_from(&path, 2).unwrap().unwrap().collect();
    assert_eq!(seqs(&rest.unwrap()), [2, 3]);
    assert_eq!(
        records_from(&path, 9)
            .unwrap()
            .into_iter()
            .flatten()
            .count(),
        0
    );
}

#[test]
fn the_end_of_the_stream_is_no_pose_and_what_follows_it_is_cut_off() {
    let (_folder, path) = journal_of(3);
    let mut end = pose(3);
    end.item.flags = flag::END;
    let mut journal = Journal::open(&path).unwrap();
    journal.append(&end).unwrap();
    let (last, ended) = journal.last(2).unwrap();
    assert_eq!((seqs(&last), ended), (vec![1, 2], true));
    let content = check(&path).unwrap();
    assert_eq!((content.poses, content.ended, content.torn), (3, true, 0));
    assert_eq!(seqs(&Vec::from(content.last)), [0, 1, 2]);
    (4..6).for_each(|seq| journal.append(&pose(seq)).unwrap());
    drop(journal);
    let content = check(&path).unwrap();
    assert_eq!((content.poses, content.ended, content.torn), (3, true, 2));
    cut(&path, 4).unwrap();
    let (last, ended) = Journal::open(&path).unwrap().last(9).unwrap();
    assert_eq!((seqs(&last), ended), (vec![0, 1, 2], true));
}

#[test]
fn an_incomplete_record_is_cut_off_whatever_its_length() {
    let (_folder, path) = journal_of(2);
    let complete = fs::read(&path).unwrap();
    for length in (0..complete.len()).step_by(11) {
        fs::write(&path, &complete[..length]).unwrap();
        let expected = (length.saturating_sub(MAGIC.len()) / RECORD) as u64;
        assert_eq!(check(&path).unwrap().poses, expected, "{length} bytes");
        let mut journal = Journal::open(&path).unwrap();
        journal.append(&pose(expected)).unwrap();
        assert_eq!(read(&path).len() as u64, expected + 1, "{length} bytes");
    }
}

#[test]
fn what_a_power_failure_leaves_of_the_last_records_is_cut_off() {
    for damaged in 0..6 {
        let (_folder, path) = journal_in_danger(6);
        corrupt(&path, damaged);
        let content = check(&path).unwrap();
        assert_eq!((content.poses, content.torn), (damaged, 6 - damaged));
        cut(&path, content.poses).unwrap();
        Journal::open(&path)
            .unwrap()
            .append(&pose(damaged))
            .unwrap();
        assert_eq!(read(&path), (0..=damaged).collect::<Vec<_>>());
    }
}

#[test]
fn zeros_in_place_of_the_first_page_are_cut_off() {
    let (_folder, path) = journal_in_danger(20);
    let mut bytes = fs::read(&path).unwrap();
    bytes[..4096].fill(0);
    fs::write(&path, bytes).unwrap();
    let content = check(&path).unwrap();
    assert_eq!((content.poses, content.torn), (0, 20));
}

#[test]
fn a_record_that_was_safe_and_is_not_whole_is_reported_and_left_as_it_is() {
    let (_folder, path) = journal_of(3 * GroupSync::LIMIT);
    for damaged in [0, 1, GroupSync::LIMIT] {
        let whole = fs::read(&path).unwrap();
        corrupt(&path, damaged);
        let corrupted = fs::read(&path).unwrap();
        match check(&path) {
            Err(JournalError::Damaged { pose, .. }) => assert_eq!(pose, damaged),
            other => panic!("{other:?}"),
        }
        assert_eq!(fs::read(&path).unwrap(), corrupted);
        fs::write(&path, whole).unwrap();
    }
}

#[test]
fn a_record_in_a_wrong_place_is_not_valid() {
    let (_folder, path) = journal_in_danger(4);
    let mut bytes = fs::read(&path).unwrap();
    let first = RECORDS.offset(1) as usize..RECORDS.offset(2) as usize;
    bytes.copy_within(first, RECORDS.offset(2) as usize);
    fs::write(&path, bytes).unwrap();
    assert_eq!(check(&path).unwrap().poses, 2);
}

#[test]
fn the_files_of_other_programs_and_versions_are_refused_and_left_as_they_are() {
    let (_folder, path) = journal_of(2);
    let own = fs::read(&path).unwrap();
    let earlier = [&b"gyre journal v9 "[..], &own[MAGIC.len()..]].concat();
    for (theirs, expected) in [
        (&b"something else altogether"[..], "is not a journal"),
        (&earlier[..], "of another version"),
    ] {
        fs::write(&path, theirs).unwrap();
        for error in [check(&path).err(), Journal::open(&path).err()] {
            let error = error.unwrap().to_string();
            assert!(error.contains(expected), "{error}");
        }
        assert_eq!(fs::read(&path).unwrap(), theirs);
    }
}
