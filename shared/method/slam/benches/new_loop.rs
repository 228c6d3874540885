//! Times of a pose graph of 20,000 keyframes and 500 loops on this machine, one thread, medians: a
//! new loop and its solution, the solution of the whole from the odometry, and the covariance of a
//! pose. Processor time, so that other load counts little.
#![allow(clippy::unwrap_used)]

#[path = "../tests/estimation/common/mod.rs"]
mod common;

use std::{hint::black_box, time::Duration};

use common::{Drive, ODOMETRY};
use gyre_slam::estimation::{Constraint, PoseGraph};
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rustix::time::{ClockId, clock_gettime};

const KEYFRAMES: usize = 20_000;
const AROUND: usize = 2_000;
const LOOPS: usize = 500;
const NEW_LOOPS: usize = 21;

fn main() {
    let mut drive = Drive::new(KEYFRAMES, AROUND, ODOMETRY, 1);
    let mut random = ChaCha8Rng::seed_from_u64(2);
    let mut closing = || -> Constraint {
        let from = random.random_range(AROUND..KEYFRAMES);
        let rounds = random.random_range(1..=from / AROUND);
        drive.close(from, from - rounds * AROUND)
    };
    let loops: Vec<_> = (0..LOOPS + NEW_LOOPS).map(|_| closing()).collect();

    let mut graph = PoseGraph::new(drive.truth[0], Default::default());
    for constraint in drive.odometry.iter().chain(&loops[..LOOPS]) {
        graph.apply(constraint).unwrap();
    }
    println!("{KEYFRAMES} keyframes, {LOOPS} loops; medians in ms");
    report("whole graph from the odometry", 5, |_| {
        black_box(graph.solve_anew().unwrap());
    });
    report("one new loop", NEW_LOOPS, |number| {
        graph.apply(&loops[LOOPS + number]).unwrap();
        black_box(graph.solve().unwrap());
    });
    report("covariance of a pose", 21, |number| {
        black_box(graph.pose(KEYFRAMES / 21 * number + 1).unwrap());
    });
    report("prediction of a loop", 21, |number| {
        black_box(
            graph
                .predict(KEYFRAMES - 1, KEYFRAMES / 21 * number)
                .unwrap(),
        );
    });
}

fn report(name: &str, times: usize, mut work: impl FnMut(usize)) {
    let mut times_ms: Vec<_> = (0..times)
        .map(|number| {
            let began = thread_time();
            work(number);
            1e3 * (thread_time() - began).as_secs_f64()
        })
        .collect();
    times_ms.sort_by(f64::total_cmp);
    println!(
        "{name:32} {:8.2}  (least {:.2}, most {:.2})",
        times_ms[times / 2],
        times_ms[0],
        times_ms[times - 1]
    );
}

fn thread_time() -> Duration {
    Duration::try_from(clock_gettime(ClockId::ThreadCPUTime)).unwrap()
}
