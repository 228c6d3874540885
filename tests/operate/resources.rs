//! Resources of a run: no memory per scan, no processor time while idle.

use std::{
    thread,
    time::{Duration, Instant},
};

use crate::common::{Run, STAGES, leftovers, processes, recording, send, undisturbed};
use gyre_client::ProcessStat;
use rustix::process::Signal;

#[test]
fn after_its_first_messages_a_stage_allocates_nothing_for_a_scan() {
    // So slow that the followers have come before the sixth scan: the transport allocates when a
    // listener comes.
    let with_slam = Run::of_recording().rate("6").set("slam.kind=graph");
    for run in [Run::of_recording(), with_slam] {
        run.complete();
        // The source's are the PNG decoder's own.
        for stage in &STAGES[1..] {
            let statistics = &run.summary()["stages"][stage];
            assert_eq!(statistics["processed"], recording::SCANS, "{stage}");
            let allocations = &statistics["allocations_after_five"];
            assert_eq!(allocations, 0, "{stage}: {statistics}");
        }
    }
}

#[test]
fn an_idle_pipeline_uses_no_time_and_goes_on_afterwards() {
    let run = Run::of_recording().rate("6");
    let mut running = run.start();
    let stages = running.await_stages();
    assert_eq!(stages.len(), STAGES.len(), "{stages:?}");
    // Their place is named after --out.
    let root = Some(leftovers::root(run.out()));
    assert!(stages.values().all(|pid| processes::run_of(*pid) == root));
    let source = stages["radar-replay"];
    running.await_poses(recording::SCANS / 3);
    send(source, Signal::STOP);
    // Waits for messages in flight.
    thread::sleep(Duration::from_millis(400));
    let idle = stages.iter().filter(|(_, pid)| **pid != source);
    let idle = idle.map(|(name, pid)| (name.as_str(), *pid));
    let idle: Vec<_> = idle.chain([("supervisor", running.pid())]).collect();
    let cpu_s = |pid| ProcessStat::of(pid).unwrap().cpu_s;
    let before: Vec<f64> = idle.iter().map(|(_, pid)| cpu_s(*pid)).collect();
    let since = Instant::now();
    thread::sleep(Duration::from_secs(3));
    for ((name, pid), before) in idle.iter().zip(before) {
        let (used_s, of) = (cpu_s(*pid) - before, since.elapsed());
        let is_idle = used_s < 0.01 * of.as_secs_f64();
        assert!(is_idle, "{name} computed for {used_s} s of {of:?}");
    }
    send(source, Signal::CONT);
    assert_eq!(running.complete(), undisturbed());
}
