//! The clock of the machine.

use std::fs;

use rand::{Rng, seq::IndexedRandom};

use super::{scene::Scene, tools};

/// The clock of the day is set, up to years ahead or back. Nothing but the stamps of logs depends
/// on it.
pub fn clock_step(scene: &mut Scene) -> Option<()> {
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
    scene.finished(&run, &running.finish());
    stepped
}
