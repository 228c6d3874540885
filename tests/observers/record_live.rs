//! Recordings of live runs: masking numbers the scans that it takes, and reuses numbers after a
//! restart. The newer message of a number is the one that the run's results come from.

use std::collections::BTreeMap;

use gyre_contract::flag;
use gyre_journal as journal;
use gyre_recording::{Recording, open_recording, parts};
use rustix::process::Signal;

use super::record::{ALL, WINDOW, file, recorded, replay};
use crate::common::{Run, recording, send};

const SCANS: usize = 70;

/// A live run that is recorded, with a refinement that is slower than the scans: whenever masking
/// is started again, scans that it had taken are in flight.
fn played() -> Run {
    let run = Run::small().data(recording::around_a_block());
    let run = run.rate("2").set(&format!("source.scans={SCANS}"));
    let run = run.set("run.mode=live").set(WINDOW).set(ALL);
    recorded(&run.set("stages.refinement.delay_ms=180"))
}

/// The scans of the poses in the results by their numbers.
fn scans_of_poses(run: &Run) -> BTreeMap<u64, u64> {
    let poses = journal::poses(run.out()).unwrap();
    let poses = poses.map(|pose| pose.unwrap().item);
    let poses = poses.filter(|item| !item.is(flag::END));
    poses.map(|item| (item.seq, item.scan)).collect()
}

/// Asserts that the messages of a topic are of the scans of the results. Returns the number of
/// missing ones.
fn lacking(recording: &Recording, scans: &BTreeMap<u64, u64>, topic: &str) -> u64 {
    let entries: Vec<_> = recording.entries(topic).collect();
    for entry in &entries {
        let scan = scans.get(&entry.seq);
        assert_eq!(scan, Some(&entry.scan), "{topic} {entry:?}");
    }
    (scans.len() - entries.len()) as u64
}

#[test]
fn a_recording_has_all_results_of_a_run_that_was_stopped() {
    for _ in 0..3 {
        let run = Run::small().data(recording::around_a_block());
        // Scans are in flight all the time, so that poses follow the request to stop.
        let run = run.set(WINDOW).set("stages.refinement.delay_ms=15");
        let run = recorded(&run.set(ALL).rate("max"));
        let running = run.started(20);
        running.signal(Signal::INT);
        running.end();
        let (poses, recording) = (scans_of_poses(&run), open_recording(&file(&run)).unwrap());
        for topic in ["scan", "masked", "rotation", "motion", "refined", "pose"] {
            let recorded: Vec<u64> = recording.entries(topic).map(|entry| entry.seq).collect();
            let lacks = poses.keys().filter(|seq| !recorded.contains(seq));
            assert_eq!(lacks.count(), 0, "{topic}");
        }
    }
}

#[test]
#[ignore = ".ci/nightly: kills masking and the recorder of a live run"]
fn a_recording_replays_to_the_results_after_masking_was_killed_with_the_recorder() {
    let run = played();
    let mut running = run.started(12);
    let recorder = running.await_child("record", None);
    send(recorder, Signal::KILL);
    running.kill("masking");
    running.finish().succeeded();
    assert_eq!(parts(&file(&run)).len(), 2);
    let recording = open_recording(&file(&run)).unwrap();
    let generations: Vec<u32> = recording.entries("pose").map(|it| it.generation).collect();
    assert!(generations.is_sorted() && generations.last() > generations.first());
    let (scans, missed) = (scans_of_poses(&run), recording.missed());
    for topic in ["masked", "rotation", "motion", "refined"] {
        let lacks = lacking(&recording, &scans, topic);
        assert!(lacks <= missed.get(topic).copied().unwrap_or_default());
        if lacks == 0 {
            let again = replay(&file(&run), &["--from", topic]);
            assert_eq!(again, run.odometry(), "from {topic}");
        }
        assert!(lacks == 0 || topic != "masked", "{lacks}");
    }
}

#[test]
fn a_recording_is_of_the_results_after_masking_was_killed_twice_while_no_recorder_was_there() {
    // Without poses only the recorder can know which numbers the second masking reused.
    let run = played().set("record.topics=['masked','motion']");
    let mut running = run.started(8);
    // It does nothing from here on, as if it came back only after the second kill.
    let recorder = running.await_child("record", None);
    send(recorder, Signal::STOP);
    let poses = running.poses();
    running.kill("masking");
    running.await_poses(poses + 2).kill("masking");
    send(recorder, Signal::KILL);
    running.finish().succeeded();
    assert_eq!(parts(&file(&run)).len(), 2);
    let recording = open_recording(&file(&run)).unwrap();
    let scans = scans_of_poses(&run);
    for topic in ["masked", "motion"] {
        let lacks = lacking(&recording, &scans, topic);
        assert!(lacks > 0);
        assert!(lacks <= recording.missed()[topic], "{topic} lacks {lacks}");
    }
}
