//! Commands to a running run: inputs that a resumed run and a replay have too.

use std::fs;

use crate::common::{Run, finished, recording::SCANS};

/// Slow enough for a command in the middle of the small recording.
const RATE: &str = "1.5";

fn run() -> Run {
    Run::of_recording().set("slam.kind=graph")
}

const RESULTS: [&str; 4] = [
    "odometry.csv",
    "poses.csv",
    "trajectory.tum",
    "trajectory_slam.tum",
];

fn results(run: &Run) -> Vec<String> {
    RESULTS.map(|name| run.result(name)).into()
}

#[test]
fn a_reset_begins_at_its_pose_and_is_repeated_by_a_replay_and_after_kills() {
    let run = run();
    let slow = run.clone().rate(RATE);
    let mut running = slow.started(3);
    finished!["reset", run.out(), "--pose", "10,5,90", "--keep-map"]
        .succeeded()
        .prints("the run is reset from the scan of");
    running.kill("pose-integration").kill("masking");
    running.await_poses(10);
    finished!["reset", run.out(), "--pose=-3,0,0"].succeeded();
    running.kill("masking").kill("loop-closure");
    running.finish().succeeded();
    slow.assert_counts("commands=2 breaks=2");
    for pose in ["10.000000 5.000000 0", "-3.000000 0.000000 0"] {
        let poses = slow.result("trajectory.tum");
        assert_eq!(poses.matches(pose).count(), 1, "{pose}: {poses}");
    }

    let commands = run.out().join("journal/commands.jsonl");
    let replay = self::run().set(&format!("source.commands='{}'", commands.display()));
    let killed = replay.clone().rate(RATE);
    killed.started(5).kill_supervisor();
    killed.started(9).kill_supervisor();
    replay.into(killed.out()).finish().succeeded();
    assert!(results(&killed) == results(&slow));
}

#[test]
fn a_command_that_changes_nothing_is_an_error() {
    let run = Run::of_recording();
    let slow = run.clone().rate(RATE);
    let running = slow.started(3);
    finished!["locate", run.out(), "--pose", "1,2,3"].failed_with(&["slam.map"]);
    finished!["reset", run.out(), "--keep-map"].failed_with(&["slam.kind"]);
    running.finish().succeeded();
    assert!(slow.summary().get("commands").is_none());

    let given = run.folder().join("commands.jsonl");
    let reset = r#"{"number":1,"command":{"reset":{"at":{},"keep_map":false}}"#;
    let late = run.set(&format!("source.commands='{}'", given.display()));
    let line = format!("{reset},\"from_ns\":9000000000000000000}}\n");
    fs::write(&given, line).unwrap();
    late.option("--fresh")
        .finish()
        .failed_with(&["0 of 1 commands"]);
}

#[test]
fn a_command_after_the_last_scan_is_reported_and_the_run_and_its_replay_end_well() {
    let run = run();
    // The scans of the window at a start may have been published before: they take no command.
    run.interrupt(RATE, SCANS - 2);
    let commands = run.out().join("journal/commands.jsonl");
    fs::write(&commands, "{\"number\":1,\"command\":{\"new-map\":{}}}\n").unwrap();
    run.finish()
        .succeeded()
        .prints("commands that came after the last scan");
    run.assert_counts("commands_without_scan=1");
    let replay = self::run().set(&format!("source.commands='{}'", commands.display()));
    replay.finish().succeeded().says("1 of 1 commands of");
    assert!(results(&replay) == results(&run));
}
