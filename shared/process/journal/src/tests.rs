use std::{fs, thread, time::Duration};

use gyre_contract::Item;
use gyre_storage::GroupSync;
use tempfile::TempDir;

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

fn read(folder: &TempDir) -> Vec<u64> {
    let poses: Result<Vec<_>, _> = poses(folder.path()).unwrap().collect();
    seqs(&poses.unwrap())
}

/// The folder of a run with a journal of so many poses.
fn journal_of(poses: u64) -> TempDir {
    let folder = tempfile::tempdir().unwrap();
    let mut journal = Journal::open(folder.path()).unwrap();
    (0..poses).for_each(|seq| journal.append(&pose(seq)).unwrap());
    folder
}

#[test]
fn a_journal_is_cut_when_nobody_writes_it_any_more() {
    let folder = journal_of(5);
    let writer = Journal::open(folder.path()).unwrap();
    let refused = cut(folder.path(), 3).unwrap_err();
    assert!(matches!(refused, LogError::Busy(_)), "{refused}");
    assert_eq!(read(&folder), [0, 1, 2, 3, 4]);
    let dying = thread::spawn(move || {
        thread::sleep(Duration::from_millis(100));
        let mut writer = writer;
        writer.append(&pose(5)).unwrap();
    });
    cut(folder.path(), 3).unwrap();
    dying.join().unwrap();
    assert_eq!(read(&folder), [0, 1, 2]);
}

#[test]
fn appended_poses_are_read_back() {
    let folder = journal_of(3);
    assert_eq!(read(&folder), [0, 1, 2]);
    let mut journal = Journal::open(folder.path()).unwrap();
    journal.append(&pose(3)).unwrap();
    assert_eq!(read(&folder), [0, 1, 2, 3]);
    let (last, ended) = journal.last(2).unwrap();
    assert_eq!((seqs(&last), ended), (vec![2, 3], false));
    assert_eq!(journal.last(9).unwrap().0.len(), 4);
    let rest: Result<Vec<_>, _> = poses_from(folder.path(), 2).unwrap().collect();
    assert_eq!(seqs(&rest.unwrap()), [2, 3]);
    assert_eq!(poses_from(folder.path(), 9).unwrap().count(), 0);
}

#[test]
fn the_end_of_the_stream_is_no_pose_and_what_follows_it_is_cut_off() {
    let folder = journal_of(3);
    let mut end = pose(3);
    end.item.flags = flag::END;
    let mut journal = Journal::open(folder.path()).unwrap();
    journal.append(&end).unwrap();
    let (last, ended) = journal.last(2).unwrap();
    assert_eq!((seqs(&last), ended), (vec![1, 2], true));
    let content = check(folder.path()).unwrap();
    assert_eq!((content.poses, content.ended, content.torn), (3, true, 0));
    assert_eq!(seqs(&Vec::from(content.last)), [0, 1, 2]);
    (4..6).for_each(|seq| journal.append(&pose(seq)).unwrap());
    drop(journal);
    let content = check(folder.path()).unwrap();
    assert_eq!((content.poses, content.ended, content.torn), (3, true, 2));
    cut(folder.path(), 4).unwrap();
    let mut journal = Journal::open(folder.path()).unwrap();
    let (last, ended) = journal.last(9).unwrap();
    assert_eq!((seqs(&last), ended), (vec![0, 1, 2], true));
}

#[test]
fn what_a_death_leaves_of_the_last_record_is_cut_off() {
    let folder = journal_of(2);
    let path = path(folder.path());
    let complete = fs::read(&path).unwrap();
    for length in (0..complete.len()).step_by(11) {
        fs::write(&path, &complete[..length]).unwrap();
        let expected = (length.saturating_sub(16) / (complete.len() / 2 - 8)) as u64;
        assert_eq!(
            check(folder.path()).unwrap().poses,
            expected,
            "{length} bytes"
        );
        let mut journal = Journal::open(folder.path()).unwrap();
        journal.append(&pose(expected)).unwrap();
        assert_eq!(read(&folder).len() as u64, expected + 1, "{length} bytes");
    }
}

#[test]
fn a_pose_that_was_safe_and_is_not_whole_is_reported_and_left_as_it_is() {
    let folder = journal_of(3 * GroupSync::LIMIT);
    let path = path(folder.path());
    let whole = fs::read(&path).unwrap();
    for damaged in [0, 1, GroupSync::LIMIT as usize] {
        let mut corrupted = whole.clone();
        corrupted[16 + damaged * (whole.len() / 96) + 100] ^= 1;
        fs::write(&path, &corrupted).unwrap();
        let error = check(folder.path()).unwrap_err().to_string();
        let expected = format!("poses.journal is damaged at record {damaged},");
        assert!(error.contains(&expected), "{error}");
        assert_eq!(fs::read(&path).unwrap(), corrupted);
    }
}

#[test]
fn the_files_of_other_programs_and_versions_are_refused_and_left_as_they_are() {
    let folder = journal_of(2);
    let path = path(folder.path());
    let own = fs::read(&path).unwrap();
    let earlier = [&b"gyre journal v12"[..], &own[16..]].concat();
    for (theirs, expected) in [
        (&b"something else altogether"[..], "is not a file of Gyre"),
        (&earlier[..], "of another version"),
    ] {
        fs::write(&path, theirs).unwrap();
        for error in [
            check(folder.path()).err(),
            Journal::open(folder.path()).err(),
        ] {
            let error = error.unwrap().to_string();
            assert!(error.contains(expected), "{error}");
        }
        assert_eq!(fs::read(&path).unwrap(), theirs);
    }
}
