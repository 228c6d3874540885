//! Faults where the results are written.

use std::{
    fs::{self, Permissions},
    os::unix::fs::{PermissionsExt, chown},
    path::Path,
};

use rand::Rng;

use super::{
    scene::{Scene, assert_one_sentence},
    tools::Mount,
};
use crate::common::{OtherUser, Run, assert_nothing_left_of, can_mount};

/// More than any results have.
const PLENTY: u64 = 256 << 20;

/// The disk is too small, or becomes full in the middle; then there is room again.
pub fn the_disk_is_full(scene: &mut Scene) -> Option<()> {
    if !can_mount() {
        return Some(());
    }
    let bytes = scene.configuration.undisturbed().bytes;
    let run = scene.run();
    let small = scene.one_in(2);
    let size = match small {
        true => scene.rng.random_range(16 << 10..bytes),
        false => PLENTY,
    };
    let mount = Mount::tmpfs(run.out(), size);
    let mut running = run.start();
    if !small {
        scene.moment(&mut running)?;
        mount.fill(scene.rng.random_range(0..64 << 10));
        if scene.one_in(2) {
            scene.kill_stage(&running);
        }
    }
    let ended = running.finish();
    mount.free();
    mount.remount(&format!("size={PLENTY}"));
    scene.survived(&run, &ended)
}

/// The folder of the results is mounted read-only, or loses its permissions in the middle.
pub fn the_results_are_read_only(scene: &mut Scene) -> Option<()> {
    let run = scene.run();
    if !can_mount() {
        return Some(());
    }
    if scene.one_in(3) {
        let mount = Mount::tmpfs(run.out(), PLENTY);
        mount.remount("ro");
        let ended = run.finish();
        assert_one_sentence(&ended);
        mount.remount("rw");
        return scene.resumed(&run);
    }
    let Some(user) = OtherUser::new(run.folder()) else {
        return Some(());
    };
    let mut reads = user.command();
    let reads = reads.args([crate::PROGRAM, "--version"]).output();
    if !reads.is_ok_and(|output| output.status.success()) {
        println!("skipped: the build folder is not for all users");
        return Some(());
    }
    fs::create_dir_all(run.out()).unwrap();
    chown(run.out(), Some(user.id), Some(user.id)).unwrap();
    let mut running = run.start_as(user.command_of(&run));
    // Killed before it has a guardian, a run of another user would stay in shared memory.
    running.await_stages();
    scene.moment(&mut running)?;
    let root = running.root()?;
    permit(run.out(), false);
    if scene.one_in(2) {
        scene.kill_stage(&running);
    }
    let ended = running.finish();
    assert_nothing_left_of(&root);
    permit(run.out(), true);
    scene.survived(&run, &ended)
}

/// Lets the owner write into a folder and all below, or not.
fn permit(folder: &Path, write: bool) {
    let mode = if write { 0o755 } else { 0o555 };
    let _ = fs::set_permissions(folder, Permissions::from_mode(mode));
    for entry in fs::read_dir(folder).into_iter().flatten().flatten() {
        permit(&entry.path(), write);
    }
}

/// The folder of the results is moved away, and comes back soon, after the end, or never.
pub fn the_results_vanish(scene: &mut Scene) -> Option<()> {
    let (run, mut running) = scene.started();
    running.await_poses_or_end(1);
    scene.moment(&mut running)?;
    let away = run.folder().join("away");
    match scene.rng.random_range(0..3) {
        0 => fs::remove_dir_all(run.out())
            .or_else(|_| fs::remove_dir_all(run.out()))
            .ok()?,
        back => {
            fs::rename(run.out(), &away).ok()?;
            let soon = back == 1;
            scene.pause(300);
            soon.then(|| restore(&away, &run));
        }
    }
    if scene.one_in(2) {
        scene.kill_stage(&running);
    }
    let ended = running.finish();
    restore(&away, &run);
    scene.survived(&run, &ended)
}

/// Moves the results back to where they were, unless they are there.
fn restore(away: &Path, run: &Run) {
    if away.exists() {
        let _ = fs::remove_dir_all(run.out());
        fs::rename(away, run.out()).unwrap();
    }
}
