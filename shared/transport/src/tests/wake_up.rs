//! Wake-ups: their latency, and the absence of superfluous ones.

use std::{
    sync::mpsc,
    thread,
    time::{Duration, Instant},
};

use gyre_contract::Pose;

use super::{Run, WINDOW, node, reader, send, writer};
use crate::{
    services::LogId,
    transport::{Listener, Notifier, bind_alone},
    wake::Signals,
};

const LONG: Duration = Duration::from_secs(5);

#[test]
fn a_waiting_reader_is_woken_by_a_message() {
    let run = Run::begin();
    let signals = Signals::install().unwrap();
    let mut waiting = reader::<Pose>(&run.manifest, None);
    let manifest = run.manifest.clone();
    let (received, stay) = mpsc::channel();
    let sender = thread::spawn(move || {
        let poses = writer::<Pose>(&manifest);
        thread::sleep(Duration::from_millis(50));
        let sent = Instant::now();
        send(&poses, 0, 0);
        // A publisher that exits before its reader has connected takes its message along.
        stay.recv().unwrap();
        sent
    });
    // Children of other tests may wake this process too.
    while waiting.head().unwrap().is_none() {
        let woken = signals.wait(&[waiting.listener()], None, LONG).unwrap();
        assert!(!woken.timed_out);
    }
    let awake = Instant::now();
    received.send(()).unwrap();
    let delay = awake.saturating_duration_since(sender.join().unwrap());
    println!("awake {delay:?} after sending");
    assert!(delay < Duration::from_secs(1), "{delay:?}");
}

#[test]
fn a_handshake_is_answered_once() {
    let run = Run::begin();
    let poses = writer::<Pose>(&run.manifest);
    let late = reader::<Pose>(&run.manifest, None);
    let woken = || late.listener().take().unwrap();
    poses.accept_readers().unwrap();
    assert_eq!(woken(), 1);
    // A second answer without a handshake would let wake-ups circulate for ever.
    poses.accept_readers().unwrap();
    assert_eq!(woken(), 0);
}

#[test]
fn all_followers_of_a_log_are_woken_and_a_dead_one_does_not_matter() {
    let run = Run::begin();
    let node = node(&run.manifest);
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

#[test]
fn listeners_of_many_threads_leave_the_umask_of_the_process_as_it_was() {
    let umask = || {
        let status = std::fs::read_to_string("/proc/self/status").unwrap();
        let line = status.lines().find(|line| line.starts_with("Umask:"));
        line.unwrap().to_owned()
    };
    let before = {
        // Other tests of this process open listeners too.
        let _alone = bind_alone();
        umask()
    };
    let run = Run::begin();
    let manifest = &run.manifest;
    thread::scope(|scope| {
        for _ in 0..WINDOW.observers {
            scope.spawn(move || {
                for _ in 0..300 {
                    drop(reader::<Pose>(manifest, None));
                }
            });
        }
    });
    let _alone = bind_alone();
    assert_eq!(umask(), before);
}
