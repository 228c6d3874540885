//! Limits of memory, descriptors and the sizes of files: little for the whole run, or no more for a
//! process in the middle.

use std::{fs, process::Command};

use rand::Rng;

use super::{scene::Scene, tools::limit};
use crate::common::{Pid, Run, assert_nothing_left, processes::status, wrapped};

/// Address space.
pub fn memory_runs_out(scene: &mut Scene) -> Option<()> {
    // A process without memory or descriptors may hang.
    let run = scene.run().set("run.stall_timeout_s=3");
    let bytes = 10_f64.powf(scene.rng.random_range(7.0..10.0)) as u64;
    let more = scene.rng.random_range(0..1 << 20);
    let more = |pid: Pid| {
        let size = status(pid, "VmSize")?;
        let kilobytes: u64 = size.strip_suffix(" kB")?.parse().ok()?;
        Some((kilobytes << 10) + more)
    };
    limited(scene, &run, run.command(), ("as", bytes), more)
}

pub fn descriptors_run_out(scene: &mut Scene) -> Option<()> {
    let run = scene.run().set("run.stall_timeout_s=3");
    let (few, more) = (scene.rng.random_range(4..160), scene.rng.random_range(0..3));
    let more = |pid: Pid| Some(fs::read_dir(format!("/proc/{pid}/fd")).ok()?.count() as u64 + more);
    limited(scene, &run, run.command(), ("nofile", few), more)
}

/// No file may become longer. A signal reports the limit, unless the signal is ignored.
pub fn files_may_not_grow(scene: &mut Scene) -> Option<()> {
    let run = scene.run();
    let ignored = if scene.one_in(2) {
        "trap '' XFSZ; "
    } else {
        ""
    };
    let start = format!("{ignored}exec \"$@\"");
    let command = wrapped(&["sh", "-c", &start, "sh"], &run.command());
    let most = (scene.configuration.undisturbed().bytes as f64).log2();
    let bytes = scene.rng.random_range(12.0..most).exp2() as u64;
    limited(scene, &run, command, ("fsize", bytes), |_| Some(bytes))
}

/// Starts a run with a limit, or limits a process in the middle to `of_process`, and judges the
/// end.
fn limited(
    scene: &mut Scene,
    run: &Run,
    command: Command,
    (resource, of_run): (&str, u64),
    of_process: impl Fn(Pid) -> Option<u64>,
) -> Option<()> {
    let ended = if scene.one_in(3) {
        let limit = format!("--{resource}={of_run}:");
        run.start_as(wrapped(&["prlimit", &limit], &command)).end()
    } else {
        let mut running = run.start_as(command);
        scene.moment(&mut running)?;
        let pid = match scene.one_in(3) {
            true => running.pid(),
            false => scene.stage(&running)?,
        };
        limit(pid, resource, of_process(pid)?);
        scene.kill_stage(&running);
        running.end()
    };
    // A process without memory may be ended by a signal, by Rust (SIGABRT) or because its stack
    // cannot grow (SIGSEGV). For the supervisor that is as good as a kill.
    if resource == "as" && ended.code().is_none() {
        scene.resumed(run)
    } else {
        assert_nothing_left(run.out());
        scene.survived(run, &ended)
    }
}
