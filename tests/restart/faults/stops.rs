//! SIGSTOP: a process hangs, and goes on or not.

use rand::Rng;
use rustix::process::Signal;

use super::scene::{Outcome, Scene};
use crate::common::send;

/// Any process, the supervisor too, stops and goes on.
pub fn for_a_while(scene: &mut Scene) -> Option<Outcome> {
    let run = scene.run();
    let mut running = run.start();
    scene.moment(&mut running)?;
    let pid = match scene.one_in(4) {
        true => running.pid(),
        false => scene.stage(&running)?,
    };
    send(pid, Signal::STOP);
    scene.pause(1500);
    send(pid, Signal::CONT);
    Some(scene.finished(&run, &running.finish()))
}

/// A stage stops and never goes on: the supervisor notices that poses are due and none comes.
pub fn for_good(scene: &mut Scene) -> Option<Outcome> {
    let timeout_s = scene.rng.random_range(1..=2);
    let run = scene.run().set(&format!("run.stall_timeout_s={timeout_s}"));
    let mut running = run.start();
    scene.moment(&mut running)?;
    send(scene.stage(&running)?, Signal::STOP);
    Some(scene.finished(&run, &running.finish()))
}
