//! Tests of scheduling: the priorities and processors of its stages, and how soon processors wake.

use std::{fs::File, io::Read};

use crate::common::{OtherUser, Pid, Run, leftovers, processes, recording, undisturbed};

/// The recording's six seconds in two.
const MODERATE: &str = "3";
/// The system's limit on the wake-up time of a processor.
const WAKE_LIMIT: &str = "/dev/cpu_dma_latency";

/// The niceness of a process and the processors that it may use.
fn priority(pid: Pid) -> (i32, String) {
    let nice = &processes::stat(pid).unwrap()[16];
    let cpus = processes::status(pid, "Cpus_allowed_list").unwrap();
    (nice.parse().unwrap(), cpus)
}

#[test]
fn stages_have_the_priority_and_the_processors_of_the_configuration_after_restarts_too() {
    let run = Run::of_recording()
        .rate(MODERATE)
        .set("run.scheduling.nice=3")
        .set("stages.masking.scheduling={ nice = 5, cpus = [0] }");
    let mut running = run.start();
    let stages = running.await_stages();
    running.await_poses(2);
    assert_eq!(priority(stages["refinement"]).0, 3);
    assert_eq!(priority(stages["masking"]), (5, "0".to_owned()));
    running.kill("masking");
    let again = running.await_other_stage("masking", stages["masking"]);
    running.await_poses(recording::SCANS / 3);
    assert_eq!(priority(again), (5, "0".to_owned()));
    assert_eq!(running.complete(), undisturbed());
    let refused = Run::of_recording().set("run.scheduling.nice=-21").finish();
    refused.refused_with(&["run", "nice", "-20 to 19"]);
    let processor = Run::of_recording().set("run.scheduling.cpus=[1000]");
    processor
        .finish()
        .failed_with(&["scheduling", "cpus = [1000]"]);
}

/// The limit that the system keeps to, us.
fn wake_limit() -> Option<i32> {
    let (mut file, mut limit) = (File::open(WAKE_LIMIT).ok()?, [0; 4]);
    file.read_exact(&mut limit).ok()?;
    Some(i32::from_ne_bytes(limit))
}

#[test]
fn processors_wake_within_the_limit_of_the_configuration_as_long_as_the_run_lives() {
    let Some(before) = wake_limit().filter(|limit| *limit > 7) else {
        println!("skipped: {WAKE_LIMIT} cannot be read, or has a limit already");
        return;
    };
    let run = Run::of_recording().rate(MODERATE).set("run.cpu_wake_us=7");
    let running = run.started(2);
    assert_eq!(wake_limit(), Some(7));
    running.finish().succeeded();
    assert_eq!(wake_limit(), Some(before));
    assert_eq!(run.odometry(), undisturbed());
    let killed = Run::of_recording().rate(MODERATE).set("run.cpu_wake_us=7");
    let running = killed.started(2);
    running.kill_supervisor();
    leftovers::remove(killed.out());
    assert_eq!(wake_limit(), Some(before));
}

#[test]
fn a_run_that_may_not_keep_processors_awake_does_not_start() {
    let run = Run::simulated(8).set("run.cpu_wake_us=0");
    let Some(user) = OtherUser::new(run.folder()) else {
        return;
    };
    let ended = run.start_as(user.command_of(&run)).finish();
    ended.failed_with(&["run.cpu_wake_us", WAKE_LIMIT, "Permission denied"]);
}
