//! Who is woken, how fast, and that nobody is woken for nothing.

use std::{
    sync::mpsc,
    thread,
    time::{Duration, Instant},
};

use gyre_messages::Pose;

use super::{Run, reader, send, writer};
use crate::wake::Signals;

const LONG: Duration = Duration::from_secs(5);

#[test]
fn a_sleeper_is_woken_by_a_message() {
    let run = Run::new();
    let signals = Signals::install().unwrap();
    let mut sleeper = reader::<Pose>(&run.manifest, None);
    let manifest = run.manifest.clone();
    let (received, stay) = mpsc::channel();
    let sender = thread::spawn(move || {
        let poses = writer::<Pose>(&manifest);
        thread::sleep(Duration::from_millis(50));
        let sent = Instant::now();
        send(&poses, 0, 0);
        // A publisher that leaves before its reader has met it takes its message along.
        stay.recv().unwrap();
        sent
    });
    // Other tests' children may wake us too.
    while sleeper.head().unwrap().is_none() {
        assert!(
            !signals
                .wait(&[sleeper.listener()], None, LONG)
                .unwrap()
                .timed_out
        );
    }
    let awake = Instant::now();
    received.send(()).unwrap();
    let delay = awake.saturating_duration_since(sender.join().unwrap());
    println!("awake {delay:?} after sending");
    assert!(delay < Duration::from_secs(1), "{delay:?}");
}

#[test]
fn a_greeting_is_answered_once() {
    let run = Run::new();
    let poses = writer::<Pose>(&run.manifest);
    let newcomer = reader::<Pose>(&run.manifest, None);
    let woken = || {
        let mut times = 0;
        newcomer.listener().try_wait(|_| times += 1).unwrap();
        times
    };
    poses.accept_readers().unwrap();
    assert_eq!(woken(), 1);
    // Who is woken greets: if that woke others, greetings would go around the processes for ever.
    poses.accept_readers().unwrap();
    assert_eq!(woken(), 0);
}
