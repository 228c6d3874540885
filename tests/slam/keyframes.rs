//! The log of keyframes of a run with SLAM: odometry is the same with it, and it is the same bytes
//! whatever is killed.

use std::fs;

use gyre_journal as journal;
use gyre_slam::{Keyframe, RecordLog, RecordReader, records_path};

use crate::{
    common::{Run, recording, undisturbed},
    restart::faults::configurations::slam,
};

fn run() -> Run {
    Run::of_recording().set("slam.kind=graph")
}

#[test]
fn a_run_with_slam_has_the_same_odometry_and_logs_the_keyframes_of_its_poses() {
    let run = run();
    assert_eq!(run.complete(), undisturbed());
    let mut keyframes = RecordReader::<Keyframe>::open(run.out()).unwrap();
    assert!(keyframes.has_ended());
    let poses = journal::poses(run.out()).unwrap();
    let poses: Vec<_> = poses.map(Result::unwrap).collect();
    let expected = 3..=poses.len();
    assert!(expected.contains(&keyframes.len()), "{}", keyframes.len());
    for index in 0..keyframes.len() {
        let keyframe = keyframes.read(index).unwrap();
        let pose = &poses[keyframe.seq as usize];
        assert_eq!(keyframe.scan, pose.item.scan);
        assert_eq!(keyframe.stamp_ns, pose.item.stamp_ns);
        let apart = pose.pose().error(&keyframe.pose.motion);
        assert!(apart.norm() < 1e-12, "{apart}");
        assert!(keyframe.points.len() > 100, "{}", keyframe.points.len());
    }
}

#[test]
fn keyframes_are_the_same_bytes_with_one_scan_in_flight_and_without_places_for_observers() {
    for setting in ["run.window=1", "run.observers=0"] {
        let run = run().set(setting);
        run.complete();
        slam().assert_undisturbed(&run, setting);
    }
}

#[test]
fn a_run_without_refinement_logs_keyframes_too() {
    let run = run().set("refinement.kind=none");
    run.complete();
    let keyframes = RecordReader::<Keyframe>::open(run.out()).unwrap();
    assert!(keyframes.has_ended() && keyframes.len() > 2);
}

#[test]
fn a_run_without_slam_logs_no_keyframes_and_removes_those_of_an_earlier_run() {
    let with = run();
    with.complete();
    let without = Run::of_recording().option("--fresh").into(with.out());
    assert_eq!(without.complete(), undisturbed());
    assert!(!records_path::<Keyframe>(with.out()).exists());
}

/// As after a death between two writes, or a power failure that took the end of one file alone.
#[test]
fn a_keyframe_without_its_pose_is_cut_off_and_poses_without_their_keyframe_are_computed_again() {
    for lost in ["pose", "keyframe"] {
        let run = run().rate("6");
        let running = run.started(recording::SCANS / 2);
        running.kill_supervisor();
        if lost == "pose" {
            let (poses, last) = (poses_of(&run), last_keyframe(&run));
            assert!(last > 0 && last < poses);
            journal::cut(run.out(), last).unwrap();
        } else {
            let mut log = RecordLog::<Keyframe>::open(run.out()).unwrap();
            log.cut(log.len() - 1).unwrap();
        }
        run.complete();
        slam().assert_undisturbed(&run, lost);
    }
}

fn poses_of(run: &Run) -> u64 {
    journal::check(run.out()).unwrap().poses
}

fn last_keyframe(run: &Run) -> u64 {
    let mut keyframes = RecordReader::<Keyframe>::open(run.out()).unwrap();
    let last = keyframes.len() - 1;
    keyframes.read(last).unwrap().seq
}

/// The run has ended, and its results are still to be written.
#[test]
fn results_without_keyframes_say_so() {
    let run = run();
    run.complete();
    fs::remove_file(records_path::<Keyframe>(run.out())).unwrap();
    fs::remove_file(run.out().join("journal/complete")).unwrap();
    let ended = run.finish();
    let note = "no corrected trajectory: ";
    let said = ended.stderr.lines().find(|line| line.contains(note));
    let said = said.unwrap_or_else(|| panic!("{}", ended.stderr));
    assert!(said.contains("keyframes.log has no keyframes"), "{said}");
}
