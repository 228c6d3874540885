//! `kill -9` of any process at any point of its life, and polite ends.

use std::{
    fs,
    path::Path,
    time::{Duration, Instant},
};

use gyre_contract::FollowerId;
use gyre_journal::{self as journal, checkpoint};
use gyre_slam::{Keyframe, Place, Query, records_path};
use rand::{
    Rng,
    seq::{IndexedRandom, SliceRandom},
};
use rustix::process::Signal;

use super::scene::Scene;
use crate::common::{Running, send};

/// Storms in a run: a process is restarted five times at most.
const STORMS: usize = 4;
const LIVES: usize = 8;

/// All processes in random order, each at a moment of its own.
pub fn each_process_is_killed(scene: &mut Scene) -> Option<()> {
    let mut names = scene.processes();
    names.shuffle(&mut scene.rng);
    let (run, mut running) = scene.started();
    for (name, poses) in names.iter().zip(scene.moments(names.len())) {
        running.await_poses_or_end(poses);
        scene.pause(20);
        scene.kill(&mut running, name)?;
    }
    scene.finished(&run, running)?;
    scene.restarted(&run, &names)
}

/// A process in the first milliseconds of its life, and perhaps its successor too.
pub fn a_process_is_killed_as_it_starts(scene: &mut Scene) -> Option<()> {
    let (run, mut running) = scene.started();
    let name = scene.processes().choose(&mut scene.rng)?.clone();
    let first = running.await_stage(&name);
    scene.pause(30);
    send(first, Signal::KILL);
    if scene.one_in(2) {
        let second = running.await_other_stage(&name, first);
        scene.pause(30);
        send(second, Signal::KILL);
    }
    scene.finished(&run, running)
}

/// Waits until a file has been written, or a file in a folder been made, so often that it shows.
/// `None` without so many writes within `limit`, or before the run is over.
fn await_writes(running: &mut Running, path: &Path, writes: u64, limit: Duration) -> Option<()> {
    let state = || {
        let file = fs::metadata(path).ok()?;
        Some((file.len(), file.modified().ok()?))
    };
    let (since, mut seen) = (Instant::now(), state()?);
    for _ in 0..writes {
        while state()? == seen {
            (since.elapsed() < limit && !running.is_over()).then_some(())?;
        }
        seen = state()?;
    }
    Some(())
}

/// A process at a write of a file that its successor continues from: refinement writes two such
/// files for each of its keyframes.
pub fn a_process_is_killed_as_it_writes(scene: &mut Scene) -> Option<()> {
    let (run, mut running) = scene.started();
    let (integration, closing) = ("pose-integration", FollowerId::LoopClosure.name());
    let writes = [
        ("refinement", checkpoint::path(run.out())),
        (integration, journal::path(run.out())),
        (integration, records_path::<Keyframe>(run.out())),
        (closing, records_path::<Place>(run.out())),
        (closing, records_path::<Query>(run.out())),
    ];
    let (stage, file) = writes.choose(&mut scene.rng)?;
    running.await_poses_or_end(scene.rng.random_range(scene.configuration.moments()));
    let pid = *running.stages().get(*stage)?;
    let writes = scene.rng.random_range(1..=4);
    // No process waits longer between its writes.
    await_writes(&mut running, file, writes, Duration::from_secs(2 * writes))?;
    send(pid, Signal::KILL);
    scene.finished(&run, running)
}

/// The process whose state a restart restores, in many of its lives.
pub fn a_process_is_killed_again_and_again(scene: &mut Scene) -> Option<()> {
    let name = scene.configuration.stateful;
    let run = scene.run();
    let run = run.set(&format!("stages.{name}.restart.limit=1000"));
    let mut running = run.start();
    for poses in scene.moments(LIVES) {
        running.await_poses_or_end(poses);
        scene.pause(40);
        scene.kill(&mut running, name)?;
    }
    scene.finished(&run, running)?;
    scene.restarted(&run, &[name.to_owned()])
}

/// A process when all poses are there: its death does not take them back.
pub fn a_process_is_killed_after_the_last_pose(scene: &mut Scene) -> Option<()> {
    let (run, mut running) = scene.started();
    let name = scene.processes().choose(&mut scene.rng)?.clone();
    let pid = running.await_stage(&name);
    running.await_poses_or_end(scene.configuration.poses);
    send(pid, Signal::KILL);
    scene.finished(&run, running)
}

/// Most of all processes together, again and again, and now and then the supervisor with them: the
/// same command continues.
pub fn processes_are_killed_in_storms(scene: &mut Scene) -> Option<()> {
    let (run, mut running) = scene.started();
    for storm in 1..=STORMS {
        running.await_poses_or_end(storm * scene.configuration.poses / STORMS);
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
    scene.finished(&run, running)
}

/// The supervisor, up to five times; its stages follow it.
pub fn the_supervisor_is_killed(scene: &mut Scene) -> Option<()> {
    let run = scene.run();
    for _ in 0..scene.rng.random_range(1..=5) {
        let mut running = run.start();
        scene.moment(&mut running)?;
        running.kill_supervisor();
    }
    scene.resumed(&run)
}

/// The supervisor while it writes the results.
pub fn the_supervisor_is_killed_as_it_writes_results(scene: &mut Scene) -> Option<()> {
    let (run, mut running) = scene.started();
    running.await_poses_or_end(1);
    let writes = scene.rng.random_range(1..=20);
    await_writes(&mut running, run.out(), writes, Duration::from_secs(60))?;
    running.kill_supervisor();
    scene.resumed(&run)
}

/// SIGINT or SIGTERM in the middle. The same command continues.
pub fn the_run_is_interrupted(scene: &mut Scene) -> Option<()> {
    let (run, mut running) = scene.started();
    running.await_poses_or_end(scene.moments(1)[0]);
    interrupted(scene, running, Some(130))?;
    assert_eq!(run.summary()["ending"], "interrupted");
    scene.resumed(&run)
}

/// SIGINT or SIGTERM while the processes start. Before there is anything to remove, the signal
/// simply ends the process.
pub fn the_run_is_interrupted_as_it_starts(scene: &mut Scene) -> Option<()> {
    let run = scene.run();
    for _ in 0..LIVES {
        let running = run.start();
        scene.pause(60);
        interrupted(scene, running, None)?;
    }
    scene.resumed(&run)
}

/// Interrupts a run. It ends with this code, or, where `None` is permitted, by the signal.
fn interrupted(scene: &mut Scene, running: Running, least: Option<i32>) -> Option<()> {
    running.signal(*[Signal::INT, Signal::TERM].choose(&mut scene.rng)?);
    let ended = running.finish();
    if ended.status.success() {
        return None;
    }
    assert!([Some(130), least].contains(&ended.code()), "{ended:?}");
    Some(())
}
