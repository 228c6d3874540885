//! Observers of a run: faults of observers change no result and leave nothing, and each observer
//! reports the messages that it missed.

use std::{thread, time::Duration};

use rustix::process::Signal;

use crate::common::{
    Run, Watch, assert_nothing_left,
    recording::{SCANS_AROUND as SCANS, around_a_block},
};

/// Places for observers of each topic, by default.
const PLACES: usize = 8;

/// In ten: two dozen observers start one after the other meanwhile.
const SLOW: &str = "3";

fn around() -> Run {
    Run::small().data(around_a_block())
}

/// Two of eight look on, two are stopped, two are killed, and two places are for ones that come and
/// go.
#[test]
fn observers_that_look_on_stop_die_come_and_go_change_nothing() {
    let (run, scans) = (&around().rate(SLOW), SCANS as u64);
    let mut running = run.start();
    running.await_stage("pose-integration");
    // All start at once: one after the other takes longer than the run on a busy machine.
    let started = |topic| Watch::start(run, topic);
    let lookers = ["scan", "pose"].map(started);
    let stopped = ["masked", "pose"].map(started);
    let killed = ["scan", "motion"].map(started);
    let [lookers, stopped, killed] =
        [lookers, stopped, killed].map(|of| of.map(Watch::await_message));
    stopped.iter().for_each(|watch| watch.signal(Signal::STOP));
    drop(killed.map(Watch::kill));
    for milliseconds in (0..40).step_by(4) {
        let guests = ["masked", "refined"].map(|topic| Watch::start(run, topic));
        thread::sleep(Duration::from_millis(milliseconds));
        for guest in guests {
            guest.signal(Signal::TERM);
            guest.kill().assert_consistent(scans);
        }
    }
    let [resumed, never_resumed] = stopped;
    running.await_poses_or_end(SCANS / 2);
    resumed.signal(Signal::CONT);
    assert_eq!(running.complete(), around().complete());
    for looker in lookers {
        assert!(looker.finish().assert_consistent(scans).total.is_some());
    }
    let resumed = resumed.finish();
    let (_, missed) = resumed.assert_consistent(scans).total.unwrap();
    assert!(missed > 0, "{resumed:?}");
    never_resumed.kill().assert_consistent(scans);
    assert_nothing_left(run.out());
}

#[test]
fn the_places_of_killed_observers_are_freed() {
    let run = around().rate("4");
    let running = run.started(1);
    for _ in 0..2 {
        let watches: Vec<_> = (0..PLACES).map(|_| Watch::start(&run, "pose")).collect();
        let attached = watches.into_iter().map(Watch::await_message);
        drop(attached.collect::<Vec<_>>());
    }
    running.interrupt();
}
