//! Tests of what followers publish, and of what wakes them.

use std::time::Duration;

use gyre_contract::{Fix, Item, Loop, LoopHeader, Message};

use super::{Run, WINDOW, node, writer};
use crate::{
    Manifest,
    follower::LogId,
    observer::{Next, ObservedRun},
    transport::{Listener, Notifier},
};

#[test]
fn an_observer_that_comes_late_receives_the_last_loops() {
    let run = Run::new();
    let loops = writer::<Loop>(&run.manifest);
    let kept = Loop::sizes(&WINDOW).history as u64;
    for seq in 0..kept + 5 {
        let item = Item::numbered(seq);
        let header = LoopHeader {
            item,
            later_seq: seq + 1,
            loops: seq + 1,
            ..LoopHeader::default()
        };
        loops.publish(header, None).unwrap();
    }
    let observed = ObservedRun::at(&run.manifest.root).unwrap();
    let mut observer = observed.observe::<Loop>().unwrap();
    loops.accept_readers().unwrap();
    for expected in 5..kept + 5 {
        let Next::Message(message, 0) = observer.next(Duration::ZERO).unwrap() else {
            panic!("no loop {expected}");
        };
        assert_eq!(message.item().seq, expected);
    }
    assert!(matches!(observer.next(Duration::ZERO).unwrap(), Next::Idle));
}

#[test]
fn a_run_without_slam_has_no_loops_to_observe_and_one_without_a_map_no_fixes() {
    let run = Run::new();
    let mut manifest = run.manifest.clone();
    manifest.window.slam = false;
    manifest.window.localises = false;
    manifest.write("").unwrap();
    let observed = ObservedRun::at(&run.manifest.root).unwrap();
    let refused = observed.observe::<Loop>().map(drop).unwrap_err();
    assert!(refused.to_string().contains("`loop`: only a run with SLAM"));
    let refused = observed.observe::<Fix>().map(drop).unwrap_err();
    assert!(refused.to_string().contains("`fix`: only a run with a map"));
}

#[test]
fn all_followers_of_a_log_are_woken_and_a_dead_one_does_not_matter() {
    let run = Run::new();
    let manifest: &Manifest = &run.manifest;
    let node = node(manifest);
    let event = LogId::Keyframes.name();
    let notifier = Notifier::open(&node, event).unwrap();
    let [first, second] = [(); 2].map(|()| Listener::open(&node, event).unwrap());
    let woken = |listener: &Listener| listener.take().unwrap() > 0;
    notifier.notify().unwrap();
    assert!(woken(&first) && woken(&second) && !woken(&first));
    drop(first);
    notifier.notify().unwrap();
    assert!(woken(&second));
}
