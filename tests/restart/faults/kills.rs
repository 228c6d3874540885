//! `kill -9` of any process at any point of its life, and polite ends.

use std::time::Duration;

use gyre_journal::{self as journal, checkpoint};
use gyre_messages::FollowerId;
use gyre_slam::{Keyframe, Place, Query, records_path};
use rand::{Rng, seq::IndexedRandom};
use rustix::process::Signal;

use super::{
    scene::{Outcome, Scene},
    watch::Watch,
};
use crate::common::{STAGES, send};

/// No process waits longer between two writes.
const NO_MORE_WRITES: Duration = Duration::from_secs(2);
/// Storms in a run: a process is restarted five times at most.
const STORMS: usize = 4;

/// One stage after the other.
pub fn stage(scene: &mut Scene) -> Option<Outcome> {
    let run = scene.run();
    let mut running = run.start();
    let mut killed = None;
    for _ in 0..scene.rng.random_range(1..=3) {
        if scene.moment(&mut running).is_some() {
            killed = killed.or(scene.kill_stage(&running));
        }
    }
    let outcome = scene.finished(&run, &running.finish());
    killed.map(|()| outcome)
}

/// Two to all stages at once.
pub fn several(scene: &mut Scene) -> Option<Outcome> {
    let run = scene.run();
    let mut running = run.start();
    running.await_stages();
    scene.moment(&mut running)?;
    let mut stages: Vec<_> = running.stages().into_values().collect();
    while stages.len() > 2 && !scene.one_in(4) {
        stages.swap_remove(scene.rng.random_range(0..stages.len()));
    }
    stages.iter().for_each(|pid| send(*pid, Signal::KILL));
    let outcome = scene.finished(&run, &running.finish());
    (stages.len() > 1).then_some(outcome)
}

/// A stage in the first milliseconds of its life, and perhaps its successor too.
pub fn at_the_start(scene: &mut Scene) -> Option<Outcome> {
    let run = scene.run();
    let mut running = run.start();
    let followers = [FollowerId::LoopClosure, FollowerId::Trajectory];
    let all = [&STAGES[..], &followers.map(FollowerId::name)].concat();
    let stage = all.choose(&mut scene.rng)?;
    let first = running.await_stage(stage);
    scene.pause(30);
    send(first, Signal::KILL);
    if scene.one_in(2) {
        let second = running.await_other_stage(stage, first);
        scene.pause(30);
        send(second, Signal::KILL);
    }
    Some(scene.finished(&run, &running.finish()))
}

/// A process at a write of a file from which its successor continues: refinement has two of them
/// for each of its keyframes.
pub fn at_a_write(scene: &mut Scene) -> Option<Outcome> {
    let run = scene.run();
    let mut running = run.start();
    let (integration, closing) = ("pose-integration", FollowerId::LoopClosure.name());
    let writes = [
        ("refinement", checkpoint::path(run.out())),
        (integration, journal::path(run.out())),
        (integration, records_path::<Keyframe>(run.out())),
        (closing, records_path::<Place>(run.out())),
        (closing, records_path::<Query>(run.out())),
    ];
    let (stage, file) = writes.choose(&mut scene.rng)?;
    running.await_poses_or_end(scene.rng.random_range(1..scene.drive.scans));
    let pid = *running.stages().get(*stage)?;
    let writes = scene.rng.random_range(1..=4);
    Watch::of(file)?.wait(writes, NO_MORE_WRITES, |_| true)?;
    send(pid, Signal::KILL);
    Some(scene.finished(&run, &running.finish()))
}

/// Most of all processes together, again and again, and now and then the supervisor with them: the
/// same command goes on.
pub fn storms(scene: &mut Scene) -> Option<Outcome> {
    let run = scene.run();
    let mut running = run.start();
    for storm in 1..=STORMS {
        running.await_poses_or_end(storm * scene.drive.scans / STORMS);
        scene.pause(50);
        if running.is_over() {
            break;
        }
        let victims = running.stages().into_values();
        victims
            .filter(|_| scene.rng.random_bool(0.6))
            .for_each(|pid| send(pid, Signal::KILL));
        if scene.one_in(3) {
            running.kill_supervisor();
            running = run.start();
        }
    }
    Some(scene.finished(&run, &running.finish()))
}

/// The supervisor, up to three times; its stages follow it.
pub fn supervisor(scene: &mut Scene) -> Option<Outcome> {
    let run = scene.run();
    for _ in 0..scene.rng.random_range(1..=3) {
        let mut running = run.start();
        scene.moment(&mut running)?;
        running.kill_supervisor();
    }
    Some(scene.resumed(&run))
}

/// The supervisor while it writes the results.
pub fn at_the_results(scene: &mut Scene) -> Option<Outcome> {
    let run = scene.run();
    let mut running = run.start();
    running.await_poses_or_end(1);
    let watch = Watch::of(run.out())?;
    let writes = scene.rng.random_range(1..=20);
    watch.wait(writes, Duration::from_secs(60), |file| file != "log.jsonl")?;
    running.kill_supervisor();
    Some(scene.resumed(&run))
}

/// SIGINT or SIGTERM. Before there is anything to remove, it simply ends the process.
pub fn interrupt(scene: &mut Scene) -> Option<Outcome> {
    let run = scene.run();
    let mut running = run.start();
    scene.moment(&mut running)?;
    running.signal(*[Signal::INT, Signal::TERM].choose(&mut scene.rng)?);
    let ended = running.finish();
    if ended.status.success() {
        return Some(scene.finished(&run, &ended));
    }
    assert!(matches!(ended.code(), Some(130) | None), "{ended:?}");
    Some(scene.resumed(&run))
}
