//! Parts of a recording that are moved away, as to another disk, while the recorder writes.

use std::{fs, path::Path};

use gyre_recording::{Recording, open_recording, parts};
use rustix::process::Signal;

use super::record::{file, played, recorded, replay, seqs};
use crate::common::{finished, recording::SCANS, send, undisturbed};

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
    running.finish().succeeded();
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
