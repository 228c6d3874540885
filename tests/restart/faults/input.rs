//! Faults where the recording is read.

use std::{fs, path::Path};

use rand::Rng;

use super::scene::Scene;

/// The interval of the scans, s.
const PERIOD_S: f64 = 0.25;

/// Scans are missing, one long gap among them, during which the watchdog must not lose patience. A
/// stage is killed besides.
pub fn the_recording_has_gaps(scene: &mut Scene) -> Option<()> {
    let scans = scene.configuration.poses;
    let gap = scene.rng.random_range(scans / 6..scans / 3);
    let first = scene.rng.random_range(2..scans - gap - 2);
    let missing: Vec<usize> = (0..scans / 12)
        .map(|_| scene.rng.random_range(0..scans))
        .collect();
    let recording = scene
        .configuration
        .copy(|scan| !(first..first + gap).contains(&scan) && !missing.contains(&scan));
    let alone = scene.configuration.run_of(recording.path(), "max");
    alone.complete();

    let gap_s = 2.0;
    let rate = (gap as f64 * PERIOD_S / gap_s).min(1000.0);
    let run = scene
        .configuration
        .run_of(recording.path(), &format!("{rate:.3}"));
    let run = run.set("run.stall_timeout_s=1");
    let mut running = run.start();
    scene.moment(&mut running)?;
    scene.kill_stage(&running);
    scene.finished_with(&scene.configuration.results(&alone), &run, running)
}

/// The images are moved away, and come back soon or only after the end.
pub fn the_recording_vanishes(scene: &mut Scene) -> Option<()> {
    let recording = scene.configuration.copy(|_| true);
    let images = folder_of_images(recording.path());
    let away = recording.path().join("away");
    let run = scene
        .configuration
        .run_of(recording.path(), scene.configuration.rate());
    let mut running = run.start();
    running.await_poses_or_end(1);
    scene.moment(&mut running)?;
    fs::rename(&images, &away).unwrap();
    if scene.one_in(2) {
        scene.kill_stage(&running);
    }
    scene.pause(1500);
    if scene.one_in(2) {
        fs::rename(&away, &images).unwrap();
    }
    let ended = running.finish();
    if away.exists() {
        fs::rename(&away, &images).unwrap();
    }
    scene.survived(&run, &ended)
}

fn folder_of_images(recording: &Path) -> std::path::PathBuf {
    let images = crate::common::recording::images(recording);
    images[0].parent().unwrap().to_owned()
}
