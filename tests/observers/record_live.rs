//! Recordings of live runs: masking numbers the scans that it takes, and reuses numbers after a
//! restart. The newer message of a number is the one that the run's results come from.

use std::collections::BTreeMap;

use gyre_contract::flag;
use gyre_journal as journal;
use gyre_recording::{open_recording, parts};
use rustix::process::Signal;

use super::record::{WINDOW, await_recorder, file, recorded, replay};
use crate::common::{Run, recording, send};

const SCANS: usize = 70;
const TOPICS: &str = "record.topics=['scan','masked','rotation','motion','refined','pose']";

/// A live run that is recorded, with a refinement that is slower than the scans: whenever masking
/// is started again, scans that it had taken are in flight.
fn played() -> Run {
    let run = Run::small().data(recording::around_a_block());
    let run = run.rate("2").set(&format!("source.scans={SCANS}"));
    let run = run.set("run.mode=live").set(WINDOW).set(TOPICS);
    recorded(&run.set("stages.refinement.delay_ms=180"))
}

/// Asserts that the recording contains the results: item by item, and by a replay of each complete
/// topic. Returns the missing items.
fn assert_is_of(run: &Run) -> BTreeMap<&'static str, usize> {
    let recording = open_recording(&file(run)).unwrap();
    let items = |topic| -> BTreeMap<u64, (u64, i64)> {
        let entries = recording.entries(topic);
        let items = entries.map(|entry| (entry.seq, (entry.scan, entry.stamp_ns)));
        items.collect()
    };
    let poses = items("pose");
    assert!(poses.len() > 20, "{}", poses.len());
    let generations: Vec<u32> = recording.entries("pose").map(|it| it.generation).collect();
    assert!(generations.is_sorted());
    assert!(generations.last() > generations.first(), "{generations:?}");
    let scans: BTreeMap<u64, i64> = items("scan").into_values().collect();
    for (scan, stamp_ns) in poses.values() {
        assert!(scans.get(scan).is_none_or(|it| it == stamp_ns), "{scan}");
    }
    let missed = recording.missed();
    let mut lacking = BTreeMap::new();
    for topic in ["masked", "rotation", "motion", "refined"] {
        let recorded = items(topic);
        for (seq, item) in &recorded {
            assert_eq!(poses.get(seq), Some(item), "{topic} {seq}");
        }
        let lacks = poses.len() - recorded.len();
        assert!(lacks as u64 <= missed.get(topic).copied().unwrap_or_default());
        match lacks {
            0 => assert_eq!(
                replay(&file(run), &["--from", topic]),
                run.odometry(),
                "from {topic}"
            ),
            _ => drop(lacking.insert(topic, lacks)),
        }
    }
    lacking
}

#[test]
#[ignore = ".ci/nightly: kills at many moments"]
fn a_recording_is_of_the_results_after_masking_was_killed_with_the_recorder() {
    let run = played();
    let mut running = run.start();
    running.await_poses(12);
    let recorder = await_recorder(&mut running, None);
    send(recorder, Signal::KILL);
    running.kill("masking");
    running.finish().succeeded();
    assert_eq!(parts(&file(&run)).len(), 2);
    assert!(!assert_is_of(&run).contains_key("masked"));
}

/// The scans of the poses in the results by their numbers.
fn scans_of_poses(run: &Run) -> BTreeMap<u64, u64> {
    let poses = journal::poses(run.out()).unwrap();
    let poses = poses.map(|pose| pose.unwrap().item);
    let poses = poses.filter(|item| !item.is(flag::END));
    poses.map(|item| (item.seq, item.scan)).collect()
}

#[test]
fn a_recording_has_all_results_of_a_run_that_was_stopped() {
    for _ in 0..3 {
        let run = Run::small().data(recording::around_a_block());
        // Scans are in flight all the time, so that poses follow the request to stop.
        let run = run.set(WINDOW).set("stages.refinement.delay_ms=15");
        let run = recorded(&run.set(TOPICS).rate("max"));
        let mut running = run.start();
        running.await_poses(20);
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
fn a_recording_is_of_the_results_after_masking_was_killed_twice_while_no_recorder_was_there() {
    // Without poses only the recorder can know which numbers the second masking reused.
    let run = played().set("record.topics=['masked','motion']");
    let mut running = run.start();
    running.await_poses(8);
    // It does nothing from here on, as if it came back only after the second kill.
    let recorder = await_recorder(&mut running, None);
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
        let entries: Vec<_> = recording.entries(topic).collect();
        for entry in &entries {
            let scan = scans.get(&entry.seq);
            assert_eq!(scan, Some(&entry.scan), "{topic} {entry:?}");
        }
        let lacks = (scans.len() - entries.len()) as u64;
        assert!(lacks > 0);
        assert!(lacks <= recording.missed()[topic], "{topic} lacks {lacks}");
    }
}
