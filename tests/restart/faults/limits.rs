//! Limits of memory and descriptors.

use std::fs;

use rand::Rng;

use super::{scene::Scene, tools::limit};
use crate::common::{Ended, Pid, Run, assert_nothing_left, wrapped};

/// Address space: little for the whole run, or nothing more for a process in the middle.
pub fn memory(scene: &mut Scene) -> Option<()> {
    let run = scene.run().set("run.stall_timeout_s=3");
    if scene.one_in(3) {
        let bytes = 10_f64.powf(scene.rng.random_range(7.0..10.0)) as u64;
        let limit = format!("--as={bytes}:");
        let ended = run
            .start_as(wrapped(&["prlimit", &limit], &run.command()))
            .end();
        out_of_memory(scene, &run, &ended);
        return Some(());
    }
    let mut running = run.start();
    scene.moment(&mut running)?;
    let pid = match scene.one_in(3) {
        true => running.pid(),
        false => scene.stage(&running)?,
    };
    limit(
        pid,
        "as",
        address_space(pid)? + scene.rng.random_range(0..1 << 20),
    );
    scene.kill_stage(&running);
    let ended = running.end();
    out_of_memory(scene, &run, &ended);
    Some(())
}

/// A process without memory may be ended by a signal, by Rust (SIGABRT) or because its stack cannot
/// grow (SIGSEGV). For the supervisor that is as good as a kill.
fn out_of_memory(scene: &Scene, run: &Run, ended: &Ended) {
    if ended.code().is_none() {
        return scene.resumed(run);
    }
    assert_nothing_left(run.out());
    scene.survived(run, ended);
}

fn address_space(pid: Pid) -> Option<u64> {
    let status = fs::read_to_string(format!("/proc/{pid}/status")).ok()?;
    let line = status
        .lines()
        .find_map(|line| line.strip_prefix("VmSize:"))?;
    let kilobytes: u64 = line.trim().strip_suffix(" kB")?.parse().ok()?;
    Some(kilobytes << 10)
}

/// Descriptors: few for the whole run, or no more for a process in the middle.
pub fn descriptors(scene: &mut Scene) -> Option<()> {
    // A process without descriptors may hang.
    let run = scene.run().set("run.stall_timeout_s=3");
    if scene.one_in(3) {
        let limit = format!("--nofile={}:", scene.rng.random_range(4..160));
        let ended = run
            .start_as(wrapped(&["prlimit", &limit], &run.command()))
            .finish();
        scene.survived(&run, &ended);
        return Some(());
    }
    let mut running = run.start();
    scene.moment(&mut running)?;
    let pid = match scene.one_in(2) {
        true => running.pid(),
        false => scene.stage(&running)?,
    };
    let open = fs::read_dir(format!("/proc/{pid}/fd")).ok()?.count() as u64;
    limit(pid, "nofile", open + scene.rng.random_range(0..3));
    scene.kill_stage(&running);
    let ended = running.finish();
    scene.survived(&run, &ended);
    Some(())
}
