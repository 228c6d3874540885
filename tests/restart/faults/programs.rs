//! The program is replaced while it runs, or runs twice.

use std::{fs, os::unix::fs::symlink, path::Path, process::Command};

use rand::{Rng, seq::IndexedRandom};

use super::{
    scene::{End, Outcome, Scene, assert_one_sentence},
    tools::Mount,
};
use crate::common::{Ended, Run, copy_program, install, wrapped};

/// The program's file is removed or replaced, by another build or by something else; then a stage
/// is killed.
pub fn replaced(scene: &mut Scene) -> Option<Outcome> {
    let run = scene.run();
    let program = run.folder().join("gyre");
    copy_program(&program);
    let original = run.folder().join("original");
    fs::hard_link(&program, &original).unwrap();
    let own = run.command();
    let mut command = Command::new(&program);
    command.args(own.get_args());
    let mut running = run.start_as(command);
    scene.moment(&mut running)?;
    replace(
        &program,
        ["removed", "rebuilt", "other"].choose(&mut scene.rng)?,
    );
    scene.kill_stage(&running);
    let ended = running.finish();
    fs::rename(&original, &program).unwrap();
    Some(scene.survived(&run, &ended))
}

fn replace(program: &Path, how: &str) {
    let new = program.with_extension("new");
    match how {
        "removed" => return fs::remove_file(program).unwrap(),
        "rebuilt" => {
            let mut bytes = fs::read(program).unwrap();
            bytes.extend(b"another build");
            install(&new, bytes);
        }
        _ => install(&new, "#!/bin/sh\necho 'another program' >&2; exit 1\n"),
    }
    fs::rename(&new, program).unwrap();
}

/// The ways to the same folder of results.
const ROADS: [&str; 6] = [
    "path",
    "link",
    "mount",
    "shared memory",
    "detour",
    "at once",
];

/// A second run with the same results is refused, by whatever road it comes. The first goes on.
pub fn second_run(scene: &mut Scene) -> Option<Outcome> {
    let road = *ROADS.choose(&mut scene.rng)?;
    println!("{road}");
    if road == "at once" {
        return Some(both_at_once(scene, &scene.run()));
    }
    let run = scene.drive.run_in(4.0);
    let place = run.folder().join("place");
    let mut running = run.start();
    running.await_poses_or_end(scene.rng.random_range(1..scene.drive.scans / 2));
    let _mount = (road == "mount").then(|| Mount::bind(run.out(), &place));
    let second = match road {
        "link" => {
            symlink(run.out(), &place).unwrap();
            run.clone().into(&place).command()
        }
        "mount" => run.clone().into(&place).command(),
        "detour" => run.clone().into(&run.out().join("log/..")).command(),
        "shared memory" => {
            let own = "mount -t tmpfs tmpfs /dev/shm && exec \"$@\"";
            wrapped(
                &["unshare", "--mount", "sh", "-c", own, "sh"],
                &run.command(),
            )
        }
        _ => run.command(),
    };
    let second = Ended::of(second);
    let came_too_late = running.is_over();
    if came_too_late {
        return None;
    }
    second.refused_with(&["another command is writing to", "--out"]);
    scene.finished(&run, &running.finish());
    Some(Outcome::from(End::Refused))
}

/// Two runs begin at the same moment: one at most is refused, and the results are right.
fn both_at_once(scene: &mut Scene, run: &Run) -> Outcome {
    let running = run.start();
    let second = Ended::of(run.command());
    let first = running.finish();
    for ended in [&first, &second] {
        match ended.status.success() {
            true => drop(ended.succeeded()),
            false => assert_one_sentence(ended),
        }
    }
    assert!(
        first.status.success() || second.status.success(),
        "{first:?}\n{second:?}"
    );
    scene.resumed(run).refused()
}
