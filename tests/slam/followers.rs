//! The followers of a run with SLAM: faults of followers do not affect odometry, and the followers
//! write the same bytes.

use std::fs;

use gyre_contract::FollowerId;
use gyre_slam::{Query, RecordReader};
use rustix::process::Signal;

use crate::{
    common::{
        Run, Watch,
        recording::{MODERATE, SCANS_AROUND as SCANS, around_a_block},
        send,
    },
    restart::faults::configurations::loops,
};

const LOOP_CLOSURE: &str = FollowerId::LoopClosure.name();
const TRAJECTORY: &str = FollowerId::Trajectory.name();

fn without_slam() -> Run {
    Run::small().data(around_a_block())
}

fn run() -> Run {
    without_slam().set("slam.kind=graph")
}

fn loops_of(run: &Run) -> usize {
    let mut queries = RecordReader::<Query>::open(run.out()).unwrap();
    assert!(queries.has_ended());
    (0..queries.len())
        .map(|index| queries.read(index).unwrap().loops().count())
        .sum()
}

fn restarts(run: &Run, process: &str) -> u64 {
    run.summary()["restarts"][process].as_u64().unwrap_or(0)
}

#[test]
#[ignore = ".ci/nightly: a drive with loops in several runs"]
fn a_stopped_loop_closure_does_not_hold_odometry_back_and_is_waited_for_at_the_end() {
    let run = run();
    let mut running = run.start();
    let pid = running.await_stage(LOOP_CLOSURE);
    send(pid, Signal::STOP);
    running
        .await_poses(SCANS)
        .await_words("waiting for loop-closure: 0 of 0 records");
    send(pid, Signal::CONT);
    running.finish().succeeded();
    loops().assert_undisturbed(&run, "stopped");
    assert_eq!(restarts(&run, LOOP_CLOSURE), 0);
}

#[test]
#[ignore = ".ci/nightly: a drive with loops in several runs"]
fn a_run_that_is_interrupted_while_it_waits_for_loops_goes_on_where_it_was() {
    let slow = run().set("stages.loop-closure.delay_ms=200");
    let mut running = slow.start();
    running
        .await_poses(SCANS)
        .await_words("waiting for loop-closure: ");
    running.interrupt();
    let odometry = without_slam().complete();
    assert!(slow.odometry() == odometry);
    let run = run().into(slow.out());
    run.finish().succeeded().says("resuming after");
    loops().assert_undisturbed(&run, "resumed");
}

#[test]
#[ignore = ".ci/nightly: a drive with loops in several runs"]
fn odometry_goes_on_without_a_follower_that_always_dies_and_the_same_command_makes_up_for_it() {
    [LOOP_CLOSURE, TRAJECTORY]
        .into_iter()
        .for_each(assert_made_up_for);
}

fn assert_made_up_for(follower: &str) {
    let run = run();
    let broken = run.folder().join("broken");
    fs::write(&broken, "").unwrap();
    let script =
        "[ ! -e {broken} ] || { echo 'no more loops' >&2; exit 7; }; exec {gyre} stage {follower}"
            .replace("{broken}", broken.to_str().unwrap())
            .replace("{follower}", follower);
    let run = run
        .stage_script(follower, &script)
        .set(&format!("stages.{follower}.restart.limit=2"));
    let ended = run.finish();
    let died = format!("{follower} died 3 times");
    ended.failed_with(&[&died, "exit code 7", "no more loops", "the same command"]);
    let goes_on = format!("odometry continues without {follower}");
    ended.says(&goes_on);
    assert!(run.odometry() == without_slam().complete());
    fs::remove_file(broken).unwrap();
    run.complete();
    loops().assert_undisturbed(&run, follower);
}

#[test]
fn a_run_that_goes_on_without_a_follower_can_be_interrupted() {
    let script = "echo 'no more loops' >&2; exit 2";
    let run = run().rate("8").stage_script(LOOP_CLOSURE, script);
    let mut running = run.start();
    let given_up = format!("odometry continues without {LOOP_CLOSURE}");
    running.await_words(&given_up).await_poses(2);
    running.interrupt();
    assert_eq!(run.summary()["ending"], "interrupted");
}

#[test]
fn loops_and_corrections_can_be_watched() {
    let run = run().rate(MODERATE);
    let mut running = run.start();
    running.await_stage(TRAJECTORY);
    let watches = ["loop", "correction"].map(|topic| Watch::start(&run, topic).await_message());
    running.kill(TRAJECTORY);
    running.finish().succeeded();
    let [loops, corrections] = watches.map(Watch::finish);
    assert!(loops_of(&run) > 10, "{}", loops_of(&run));
    assert_eq!(loops.seqs, (0..loops_of(&run) as u64).collect::<Vec<_>>());
    assert!(corrections.seqs.is_sorted_by(|a, b| a < b));
    assert!(corrections.seqs.len() > SCANS / 10);
}
