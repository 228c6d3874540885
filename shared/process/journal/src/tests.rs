use std::{thread, time::Duration};

use gyre_contract::Item;
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
