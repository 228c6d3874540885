//! Parts of a recording that ends a file by its size or its time: each is read alone, and each
//! message is in one of them. They may be moved away, as to another disk, while the recorder
//! writes.

use std::{
    fs,
    path::{Path, PathBuf},
    process::Child,
    slice,
};

use gyre_recording::{Recording, open_recording, parts};
use rustix::process::Signal;

use super::record::{ALL, file, played, recorded, replay, seqs};
use crate::common::{Run, finished, gyre, recording::SCANS, send, undisturbed};

/// Reads each part alone; returns the numbers of the messages of a topic, part by part.
fn seqs_in(parts: &[PathBuf], topic: &str) -> Vec<u64> {
    let mut all = Vec::new();
    for part in parts {
        let mut alone = Recording::open(slice::from_ref(part)).unwrap();
        assert_eq!(alone.damages().count(), 0, "{}", part.display());
        for seq in seqs(&alone, topic) {
            alone.read(topic, seq).unwrap();
            all.push(seq);
        }
    }
    all
}

#[test]
fn a_recording_goes_on_in_the_next_file_and_each_message_is_in_one_of_them() {
    for (setting, least_bytes) in [("record.split_s=0.7", 1), ("record.split_mb=1", 1_000_000)] {
        let run = recorded(&played()).set(ALL).rate("2").set(setting);
        assert_eq!(run.complete(), undisturbed(), "{setting}");
        let parts = parts(&file(&run));
        assert!(parts.len() > 1, "{setting}");
        assert_eq!(parts[1], run.folder().join("drive.2.mcap"));
        for part in &parts[..parts.len() - 1] {
            let bytes = fs::metadata(part).unwrap().len();
            assert!(bytes >= least_bytes, "{setting}: {bytes}");
        }
        for topic in ["scan", "masked", "rotation", "motion", "refined", "pose"] {
            let all: Vec<u64> = (0..SCANS as u64).collect();
            assert_eq!(seqs_in(&parts, topic), all, "{setting}: {topic}");
        }
    }
}

fn recorder(run: &Run, options: [&str; 2]) -> Child {
    let mut record = gyre();
    record.arg("record").arg(run.out()).arg("--to");
    record.arg(file(run)).args(options).spawn().unwrap()
}

#[test]
fn a_recorder_from_outside_goes_on_in_the_next_file_too() {
    let run = played().rate("1");
    let running = run.started(SCANS / 4);
    let mut recorder = recorder(&run, ["--split-s", "0.7"]);
    running.finish().succeeded();
    assert!(recorder.wait().unwrap().success());
    let parts = parts(&file(&run));
    assert!(parts.len() > 1, "{parts:?}");
    for topic in ["scan", "pose"] {
        let seqs = seqs_in(&parts, topic);
        let all: Vec<u64> = (seqs[0]..SCANS as u64).collect();
        assert_eq!(seqs, all, "{topic}");
    }
}

#[test]
fn a_recording_from_the_middle_of_a_drive_is_refused_where_all_messages_are_needed() {
    let run = played().rate("1").set("run.window=1");
    let running = run.started(SCANS / 3);
    let mut recorder = recorder(&run, ["--topics", "scan,masked"]);
    running.finish().succeeded();
    recorder.wait().unwrap();
    let scans = seqs_in(&parts(&file(&run)), "scan");
    assert!(!scans.is_empty() && scans[0] > 0, "{scans:?}");
    let replay = Run::small().data(&file(&run)).argument("--from", "masked");
    let lacks = "lacks message 0 of topic `masked`";
    replay.finish().refused_with(&[lacks]);
}

/// Moves all parts but the newest one; returns how many.
fn move_away(recording: &Path, to: &Path) -> usize {
    let mut parts = parts(recording);
    parts.pop();
    for part in &parts {
        let moved = to.join(part.file_name().unwrap());
        assert!(!moved.exists(), "{} is overwritten", moved.display());
        fs::rename(part, moved).unwrap();
    }
    parts.len()
}

#[test]
fn parts_are_moved_away_while_the_recording_goes_on_and_none_is_overwritten() {
    let run = recorded(&played()).rate("1").set("record.split_s=0.7");
    let other_disk = run.folder().join("disk");
    fs::create_dir(&other_disk).unwrap();
    let mut running = run.started(SCANS / 3);
    let moved = move_away(&file(&run), &other_disk);
    assert!(moved > 0);
    // A new recorder continues without the first part.
    let killed = running.await_child("record", None);
    send(killed, Signal::KILL);
    running.await_child("record", Some(killed));
    running.await_poses(2 * SCANS / 3);
    let moved = moved + move_away(&file(&run), &other_disk);
    running.finish().succeeded().says("started again");
    // The rest is a recording without its first part, and reports it.
    let rest = open_recording(&file(&run)).unwrap();
    assert!(rest.absent_parts().contains(&1));
    let inspected = finished!["inspect", file(&run)];
    inspected.prints("Part 1 of the recording");
    let left = parts(&file(&run));
    for part in &left {
        fs::rename(part, other_disk.join(part.file_name().unwrap())).unwrap();
    }
    let together = parts(&other_disk.join("drive.mcap"));
    assert_eq!(together.len(), moved + left.len());
    let whole = Recording::open(&together).unwrap();
    assert!(whole.absent_parts().is_empty() && whole.left_out().is_empty());
    assert_eq!(seqs(&whole, "scan").len(), SCANS);
    assert_eq!(whole.missed().get("scan"), None);
    assert_eq!(replay(&other_disk, &[]), undisturbed());
}
