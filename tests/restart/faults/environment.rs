//! The clock and the shared memory of the machine.

use std::{
    fs::{self, File},
    os::fd::AsRawFd,
};

use rand::{Rng, seq::IndexedRandom};

use super::{
    results::fill,
    scene::{Outcome, Scene},
    tools,
};
use crate::common::wrapped;

/// The clock of the day is set, up to years ahead or back. Nothing but the stamps of logs depends
/// on it.
pub fn clock_step(scene: &mut Scene) -> Option<Outcome> {
    let run = scene.run();
    let clock = run.folder().join("clock");
    fs::write(&clock, "+0").unwrap();
    let mut command = run.command();
    command
        .env("LD_PRELOAD", tools::faketime()?)
        .env("FAKETIME_TIMESTAMP_FILE", &clock)
        .env("FAKETIME_NO_CACHE", "1")
        .env("FAKETIME_DONT_FAKE_MONOTONIC", "1")
        .env("NO_FAKE_STAT", "1");
    let mut running = run.start_as(command);
    let mut stepped = None;
    for _ in 0..scene.rng.random_range(1..=3) {
        if scene.moment(&mut running).is_some() {
            let step = *["+400d", "-400d", "-20y", "+3600", "-1", "+0.2"].choose(&mut scene.rng)?;
            // Renamed, so that no process reads half of it.
            fs::write(clock.with_extension("new"), step).unwrap();
            fs::rename(clock.with_extension("new"), &clock).unwrap();
            stepped = Some(());
        }
    }
    if scene.one_in(2) {
        scene.kill_stage(&running);
    }
    let outcome = scene.finished(&run, &running.finish());
    stepped.map(|()| outcome)
}

/// A small `/dev/shm` of the run's own is filled by something else.
pub fn shared_memory_full(scene: &mut Scene) -> Option<Outcome> {
    let announced = scene.drive.undisturbed().shared_memory_bytes;
    let bytes = (announced as f64 * scene.rng.random_range(0.8..2.0)) as u64;
    let run = scene.run();
    let mount = format!("mount -t tmpfs -o size={bytes} tmpfs /dev/shm && exec \"$@\"");
    let own = wrapped(
        &["unshare", "--mount", "sh", "-c", &mount, "sh"],
        &run.command(),
    );
    let mut running = run.start_as(own);
    running.await_poses_or_end(1);
    // Holds it when the processes are gone.
    let shared_memory = File::open(format!("/proc/{}/root/dev/shm", running.pid())).ok();
    if let (Some(()), Some(folder)) = (scene.moment(&mut running), &shared_memory) {
        let place = format!("/proc/self/fd/{}", folder.as_raw_fd());
        fill(place.as_ref(), scene.rng.random_range(0..64 << 10));
        scene.kill_stage(&running);
    }
    let ended = running.finish();
    if let Some(folder) = shared_memory {
        let left = fs::read_dir(format!("/proc/self/fd/{}", folder.as_raw_fd())).unwrap();
        let left: Vec<_> = left
            .map(|file| file.unwrap().file_name())
            .filter(|name| name != "filler")
            .collect();
        assert!(left.is_empty(), "{left:?} are left in /dev/shm");
    }
    Some(scene.survived(&run, &ended))
}
