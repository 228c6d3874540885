//! Tests of what wakes followers.

use super::{Run, node};
use crate::{
    Manifest,
    services::LogId,
    transport::{Listener, Notifier},
};

#[test]
fn all_followers_of_a_log_are_woken_and_a_dead_one_does_not_matter() {
    let run = Run::begin();
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
