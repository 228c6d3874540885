//! Times and memory of SLAM on a drive of 20,000 keyframes and 500 loops, on this machine: a new
//! loop, and the restart of trajectory and of loop-closure from the logs of a run. Times are
//! processor time of one thread, so that other load counts little.
//!
//! `cargo run --release --manifest-path research/Cargo.toml -p gyre-lab --example slam_bench`
#![allow(clippy::unwrap_used)]

use std::{f64::consts::TAU, fs, path::Path, time::Duration};

use gyre_geometry::{Pose, SparsePoint, UncertainMotion, pose};
use gyre_matching::RefinementConfig;
use gyre_slam::{
    EstimatorKind, Keyframe, LoopCandidate, LoopCloser, LoopOutcome, Place, Query, RecordLog,
    RecordReader, SUBMAP_REACH_M, TrajectoryEstimator, estimation::places::Descriptor,
};
use nalgebra::{Matrix3, Vector3};
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, Normal};
use rustix::time::{ClockId, clock_gettime};

const KEYFRAMES: usize = 20_000;
const AROUND: usize = 2_000;
const LOOPS: usize = 500;
/// The last loops, whose times are reported.
const TIMED: usize = 100;
/// Points of a keyframe, as in the simulated drive of Oxford.
const POINTS: usize = 2_100;
/// Standard deviations of a motion of 2 m, and of a loop: m, m, rad.
const MOTION: [f64; 3] = [0.02, 0.02, 0.0005];
const CLOSING: [f64; 3] = [0.05, 0.05, 0.001];

fn main() {
    let out = tempfile::tempdir().unwrap();
    let queries = write_logs(out.path());
    println!("{KEYFRAMES} keyframes, {LOOPS} loops");
    for file in ["keyframes.log", "places.log", "loops.log"] {
        let bytes = fs::metadata(out.path().join("journal").join(file)).unwrap();
        println!("{file:40} {:8.1} MB", bytes.len() as f64 / 1e6);
    }
    measured("restart of loop-closure", || loop_closure(out.path()));
    measured("restart of trajectory", || trajectory(out.path()));
    new_loops(out.path(), &queries);
}

fn measured<T>(name: &str, work: impl FnOnce() -> T) -> T {
    let (before, began) = (resident_mb(), thread_time());
    let result = work();
    let time = 1e3 * (thread_time() - began).as_secs_f64();
    println!("{name:40} {time:8.1} ms, {:.0} MB", resident_mb() - before);
    result
}

fn loop_closure(out: &Path) -> (LoopCloser, RecordReader<Keyframe>) {
    let keyframes = RecordReader::<Keyframe>::open(out).unwrap();
    let mut closer = LoopCloser::new(SUBMAP_REACH_M, &RefinementConfig::default(), POINTS).unwrap();
    let mut places = RecordLog::<Place>::open(out).unwrap();
    for index in 0..places.len() {
        let place = places.read(index).unwrap();
        closer
            .restore_place::<std::convert::Infallible>(&place)
            .unwrap();
    }
    let mut queries = RecordLog::<Query>::open(out).unwrap();
    (0..queries.len()).for_each(|index| drop(queries.read(index).unwrap()));
    closer.restore_queries(queries.len());
    (closer, keyframes)
}

fn trajectory(out: &Path) -> TrajectoryEstimator {
    let mut estimator = pushed(out);
    let mut queries = RecordReader::<Query>::open(out).unwrap();
    for index in 0..queries.len() {
        estimator.close(&queries.read(index).unwrap()).unwrap();
    }
    estimator.update().unwrap();
    estimator.pose(KEYFRAMES - 1).unwrap();
    estimator
}

fn pushed(out: &Path) -> TrajectoryEstimator {
    let mut estimator = TrajectoryEstimator::new(EstimatorKind::Graph);
    let mut keyframes = RecordReader::<Keyframe>::open(out).unwrap();
    for index in 0..keyframes.len() {
        let keyframe = Keyframe::without_points(&mut keyframes, index).unwrap();
        estimator.push(&keyframe).unwrap();
    }
    estimator
}

fn new_loops(out: &Path, queries: &[Query]) {
    let mut estimator = pushed(out);
    let with_loops = queries.iter().filter(|query| !query.candidates.is_empty());
    let mut times_ms: Vec<f64> = with_loops
        .map(|query| {
            let began = thread_time();
            estimator.close(query).unwrap();
            estimator.update().unwrap();
            estimator.pose(KEYFRAMES - 1).unwrap();
            1e3 * (thread_time() - began).as_secs_f64()
        })
        .collect();
    let mut last = times_ms.split_off(LOOPS - TIMED);
    last.sort_by(f64::total_cmp);
    println!(
        "{:40} {:8.1} ms median, {:.1} ms 9 of 10, {:.1} ms most",
        "a new loop",
        last[TIMED / 2],
        last[TIMED * 9 / 10],
        last[TIMED - 1]
    );
    let standing = estimator.pose(KEYFRAMES - 1).unwrap().motion;
    let began = thread_time();
    estimator.solve().unwrap();
    let time = 1e3 * (thread_time() - began).as_secs_f64();
    let apart = standing.inv_mul(&estimator.poses()[KEYFRAMES - 1]);
    println!(
        "{:40} {time:8.1} ms; moves the last keyframe by {:.4} m",
        "the solution of the results",
        apart.translation.vector.norm()
    );
}

fn write_logs(out: &Path) -> Vec<Query> {
    let mut random = ChaCha8Rng::seed_from_u64(1);
    let step = pose(2.0, 0.0, TAU / AROUND as f64);
    let mut truth = vec![Pose::identity()];
    while truth.len() < KEYFRAMES {
        truth.push(truth[truth.len() - 1] * step);
    }
    let mut keyframes = RecordLog::open(out).unwrap();
    let mut places = RecordLog::open(out).unwrap();
    let mut reckoned = UncertainMotion::identity();
    for index in 0..KEYFRAMES {
        let motion = match index {
            0 => UncertainMotion::identity(),
            _ => measure(step, MOTION, &mut random),
        };
        reckoned = reckoned.then(&motion).normalized();
        let keyframe = keyframe(index, reckoned, motion);
        keyframes.append(&keyframe).unwrap();
        let place = Place {
            path_m: keyframe.path_m,
            motion,
            descriptor: Descriptor::default(),
        };
        places.append(&place).unwrap();
    }
    let every = (KEYFRAMES - AROUND) / LOOPS;
    let query = |keyframe: usize| {
        let is_closed = keyframe >= AROUND && keyframe.is_multiple_of(every);
        let candidates = is_closed.then(|| {
            let place = keyframe - random.random_range(1..=keyframe / AROUND) * AROUND;
            let motion = truth[place].inv_mul(&truth[keyframe]);
            candidate(place, measure(motion, CLOSING, &mut random))
        });
        Query {
            keyframe,
            candidates: candidates.into_iter().collect(),
        }
    };
    let queries: Vec<Query> = (0..KEYFRAMES).map(query).collect();
    let mut log = RecordLog::open(out).unwrap();
    queries.iter().for_each(|query| log.append(query).unwrap());
    queries
}

fn keyframe(index: usize, pose: UncertainMotion, motion: UncertainMotion) -> Keyframe {
    let points = vec![SparsePoint::default(); POINTS];
    Keyframe {
        stamp_ns: index as i64 * 1_000_000_000,
        motion,
        path_m: 2.0 * index as f64,
        ..Keyframe::standing(4 * index as u64, pose, points)
    }
}

fn measure(truth: Pose, sigma: [f64; 3], random: &mut ChaCha8Rng) -> UncertainMotion {
    let [x, y, yaw] = sigma.map(|sigma| Normal::new(0.0, sigma).unwrap().sample(random));
    UncertainMotion {
        motion: pose(x, y, 0.0) * truth * pose(0.0, 0.0, yaw),
        covariance: Matrix3::from_diagonal(&Vector3::from(sigma.map(|sigma| sigma * sigma))),
    }
    .normalized()
}

fn candidate(place: usize, motion: UncertainMotion) -> LoopCandidate {
    LoopCandidate {
        place,
        similarity: 0.9,
        motion,
        correlation: 0.9,
        searched: 0.9,
        runner_up: 0.3,
        chi_square: 1.0,
        outcome: LoopOutcome::Accepted,
    }
}

fn resident_mb() -> f64 {
    let status = fs::read_to_string("/proc/self/status").unwrap();
    let line = status
        .lines()
        .find(|line| line.starts_with("VmRSS"))
        .unwrap();
    line.split_whitespace()
        .nth(1)
        .unwrap()
        .parse::<f64>()
        .unwrap()
        / 1e3
}

fn thread_time() -> Duration {
    Duration::try_from(clock_gettime(ClockId::ThreadCPUTime)).unwrap()
}
