//! Fixes of GNSS in the graph: holes, reflections, wrong clocks, and what does not depend on when
//! they came.

use gyre_geometry::{
    Pose, UncertainMotion, interpolate, pose,
    samples::{GnssConfig, GnssFix},
};
use gyre_slam::{
    EstimatorKind, FixRefusal, Fixes, Keyframe, TrajectoryEstimator,
    estimation::{Constraint, G2o, GraphOptions, Kernel, PoseGraph},
};
use nalgebra::{Matrix3, Point2};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

use crate::common::reckoned;

const SECOND_NS: i64 = 1_000_000_000;
/// Standard deviations of a motion of 2 m.
const SIGMA: [f64; 3] = [0.02, 0.01, 0.001];
const LEVER_M: [f64; 2] = [-1.5, 0.5];
const SIGMA_M: f64 = 1.0;

fn east_north_from_map() -> Pose {
    pose(12.0, -7.0, 1.9)
}

/// A drive through bends at 4 to 12 m/s, with a stop in the middle: keyframes each 2 m.
struct Drive {
    stamps: Vec<i64>,
    truth: Vec<Pose>,
    keyframes: Vec<Keyframe>,
}

impl Drive {
    fn new(keyframes: usize, seed: u64) -> Self {
        let (mut stamps, mut truth) = (vec![0], vec![Pose::identity()]);
        for k in 1..keyframes {
            let along = k as f64 / 25.0;
            let turn = 0.04 * (along.sin() + 0.6 * (0.37 * along).cos());
            let speed_mps = 8.0 + 4.0 * (0.07 * k as f64).sin();
            let stop_s = if k == keyframes / 2 { 20.0 } else { 0.0 };
            stamps.push(stamps[k - 1] + ((2.0 / speed_mps + stop_s) * 1e9) as i64);
            truth.push(truth[k - 1] * pose(2.0, 0.0, turn));
        }
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        let mut keyframes = reckoned(&truth, SIGMA, &mut random, |_, _| Vec::new());
        for (keyframe, stamp_ns) in keyframes.iter_mut().zip(&stamps) {
            keyframe.stamp_ns = *stamp_ns;
        }
        Self {
            stamps,
            truth,
            keyframes,
        }
    }

    /// The true pose in the map: at the stop the vehicle stands at the earlier keyframe, and then
    /// drives on within a quarter of a second.
    fn at(&self, stamp_ns: i64) -> Pose {
        let next = self.stamps.partition_point(|it| *it <= stamp_ns);
        let next = next.clamp(1, self.stamps.len() - 1);
        let (from, to) = (self.stamps[next - 1], self.stamps[next]);
        let from = from.max(to - SECOND_NS / 4).min(to - 1);
        let share = ((stamp_ns - from) as f64 / (to - from) as f64).max(0.0);
        interpolate(&self.truth[next - 1], &self.truth[next], share)
    }

    /// Fixes at 10 Hz, white.
    fn fixes(&self, seed: u64) -> Vec<GnssFix> {
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        let last_ns = self.stamps[self.stamps.len() - 1];
        let stamps = (-20..).map(|k| k * SECOND_NS / 10 + 1_234_567);
        let stamps = stamps.take_while(|stamp_ns| *stamp_ns < last_ns + 2 * SECOND_NS);
        let mut noise = || -> f64 { StandardNormal.sample(&mut random) };
        stamps
            .map(|stamp_ns| {
                let at = east_north_from_map() * self.at(stamp_ns) * Point2::from(LEVER_M);
                GnssFix {
                    stamp_ns,
                    east_m: at.x + SIGMA_M * noise(),
                    north_m: at.y + SIGMA_M * noise(),
                    sigma_m: SIGMA_M,
                }
            })
            .collect()
    }

    fn with(&self, fixes: Vec<GnssFix>) -> TrajectoryEstimator {
        let estimator = TrajectoryEstimator::new(EstimatorKind::Graph);
        estimator.with_fixes(of_receiver(fixes))
    }

    fn solved(&self, fixes: Vec<GnssFix>) -> TrajectoryEstimator {
        let mut estimator = self.with(fixes);
        self.keyframes
            .iter()
            .for_each(|it| estimator.push(it).unwrap());
        estimator.solve().unwrap();
        estimator
    }

    fn error_m(&self, estimator: &mut TrajectoryEstimator, keyframe: usize) -> f64 {
        let frame = estimator.east_north_from_map().unwrap().unwrap().motion;
        let found = frame * estimator.poses()[keyframe];
        let truth = east_north_from_map() * self.truth[keyframe];
        (found.translation.vector - truth.translation.vector).norm()
    }
}

fn of_receiver(fixes: Vec<GnssFix>) -> Fixes {
    let config = GnssConfig {
        lever_m: LEVER_M,
        correlation_s: 0.0,
        ..GnssConfig::default()
    };
    Fixes::new(fixes, &config)
}

fn used(estimator: &TrajectoryEstimator) -> usize {
    let positions = estimator.positions();
    positions.iter().filter(|it| it.weight >= 0.25).count()
}

#[test]
fn the_drive_lies_where_the_fixes_say_and_drifts_no_more() {
    let drive = Drive::new(900, 1);
    let mut estimator = drive.solved(drive.fixes(2));
    let reckoned = drive.keyframes[899].pose.motion;
    let drift_m = (reckoned.translation.vector - drive.truth[899].translation.vector).norm();
    assert!(drift_m > 3.0, "{drift_m}");
    for keyframe in [0, 200, 450, 700, 899] {
        let error_m = drive.error_m(&mut estimator, keyframe);
        assert!(error_m < 0.6, "{keyframe}: {error_m}");
    }
    let fixes = estimator.fixes();
    assert!(fixes.refusal().is_none());
    let clock = fixes.clock().unwrap();
    assert!(clock.delay_s.abs() < 0.15, "{} s", clock.delay_s);
}

#[test]
fn all_fixes_are_counted_once() {
    let drive = Drive::new(300, 1);
    let fixes = drive.fixes(2);
    let all = fixes.len();
    let estimator = drive.solved(fixes);
    let fixes = estimator.fixes();
    let counts = fixes.counts();
    let counted = counts.outside + counts.thinned + counts.far + counts.taken;
    assert_eq!((counted, fixes.positions().len()), (all, counts.taken));
    // Two seconds before and after, and the stop of 20 s.
    assert!((38..=42).contains(&counts.outside), "{counts:?}");
    assert!(counts.far > 150 && counts.taken > 200, "{counts:?}");
}

/// The time of a reflection.
fn is_reflected(stamp_ns: i64) -> bool {
    (40 * SECOND_NS..55 * SECOND_NS).contains(&stamp_ns)
}

#[test]
fn holes_a_reflection_and_single_wrong_fixes_displace_no_keyframe() {
    /// Changes a fix, and returns whether the receiver reports it.
    type Spoil = fn(usize, &mut GnssFix) -> bool;
    fn hole<const FROM_S: i64>(_: usize, fix: &mut GnssFix) -> bool {
        !(FROM_S * SECOND_NS..(FROM_S + 20) * SECOND_NS).contains(&fix.stamp_ns)
    }
    let solved = |seed: u64, spoil: Spoil, judged_s: &[i64]| {
        let drive = Drive::new(900, seed);
        let fixes = drive.fixes(seed + 1).into_iter().enumerate();
        let fixes = fixes.filter_map(|(k, mut fix)| spoil(k, &mut fix).then_some(fix));
        let mut estimator = drive.solved(fixes.collect());
        for at_s in judged_s {
            let keyframe = drive.stamps.partition_point(|it| *it < at_s * SECOND_NS);
            let error_m = drive.error_m(&mut estimator, keyframe);
            assert!(error_m < 0.8, "seed {seed}, {at_s} s: {error_m}");
        }
        estimator
    };
    solved(3, hole::<20>, &[30]);
    solved(3, hole::<60>, &[70]);
    solved(3, hole::<100>, &[110]);
    let single: Spoil = |k, fix| {
        fix.east_m -= if k.is_multiple_of(9) { 25.0 } else { 0.0 };
        true
    };
    solved(7, single, &[25, 80, 130]);
    let reflection: Spoil = |_, fix| {
        let by_m = if is_reflected(fix.stamp_ns) { 4.0 } else { 0.0 };
        (fix.east_m, fix.north_m) = (fix.east_m + 4.0 * by_m, fix.north_m - 3.0 * by_m);
        true
    };
    let estimator = solved(5, reflection, &[47]);
    let refused = estimator.fixes().taken() - used(&estimator);
    let positions = estimator.fixes().positions().iter();
    let inside = positions.filter(|it| is_reflected(it.0)).count();
    assert!(
        refused.abs_diff(inside) <= inside / 10,
        "{refused} of {inside}"
    );
}

#[test]
fn a_clock_that_is_wrong_is_told_and_its_fixes_are_not_used() {
    let drive = Drive::new(900, 9);
    let without = drive.solved(Vec::new());
    for delay_s in [-60, -5, 1, 60] {
        let mut fixes = drive.fixes(10);
        fixes
            .iter_mut()
            .for_each(|fix| fix.stamp_ns += delay_s * SECOND_NS);
        let mut estimator = drive.solved(fixes);
        match estimator.fixes().refusal() {
            Some(FixRefusal::Clock(clock)) => {
                assert!(
                    (clock.delay_s - delay_s as f64).abs() < 0.1,
                    "{delay_s}: {clock}"
                );
            }
            // A second is within the noise of a fix.
            None if delay_s == 1 => continue,
            other => panic!("{delay_s}: {other:?}"),
        }
        assert_eq!(estimator.poses(), without.poses(), "{delay_s}");
        assert!(estimator.east_north_from_map().unwrap().is_none());
        assert_eq!(used(&estimator), 0);
    }
}

#[test]
fn fixes_of_another_drive_are_refused_as_a_whole() {
    let drive = Drive::new(500, 9);
    let without = drive.solved(Vec::new());
    // Places that have nothing to do with the drive.
    let mut fixes = drive.fixes(10);
    for (k, fix) in fixes.iter_mut().enumerate() {
        let along = k as f64 / 40.0;
        (fix.east_m, fix.north_m) = (150.0 * along.cos(), 90.0 * (2.3 * along).sin());
    }
    let estimator = drive.solved(fixes);
    assert!(estimator.fixes().refusal().is_some());
    assert_eq!(estimator.poses(), without.poses());
    let later = drive.fixes(10).into_iter().map(|fix| GnssFix {
        stamp_ns: fix.stamp_ns + 3600 * SECOND_NS,
        ..fix
    });
    let estimator = drive.solved(later.collect());
    assert_eq!(estimator.fixes().refusal(), Some(&FixRefusal::Elsewhere));
    assert_eq!(estimator.poses(), without.poses());
}

#[test]
fn a_log_that_ends_early_leaves_the_rest_to_odometry() {
    let drive = Drive::new(900, 11);
    let mut fixes = drive.fixes(12);
    fixes.retain(|fix| fix.stamp_ns < 60 * SECOND_NS);
    let mut estimator = drive.solved(fixes);
    assert!(drive.error_m(&mut estimator, 200) < 0.6);
    let sigma_m = |estimator: &mut TrajectoryEstimator, keyframe| {
        estimator.pose(keyframe).unwrap().covariance[(0, 0)].sqrt()
    };
    assert!(sigma_m(&mut estimator, 899) > 2.0 * sigma_m(&mut estimator, 200));
    let last = estimator.poses()[898].inv_mul(&estimator.poses()[899]);
    let motion = drive.keyframes[899].motion.motion;
    assert!((last.translation.vector - motion.translation.vector).norm() < 1e-6);
}

/// Each keyframe comes before the fixes around it, and some fixes come 20 s late.
#[test]
fn fixes_that_arrive_with_the_keyframes_and_late_lead_to_the_same_solution() {
    let drive = Drive::new(300, 1);
    let all = drive.fixes(2);
    let arrives_ns = |(k, fix): (usize, &GnssFix)| match k % 40 {
        7 => fix.stamp_ns + 20 * SECOND_NS,
        _ => fix.stamp_ns + SECOND_NS / 5,
    };
    let mut live = drive.with(Vec::new());
    for (k, keyframe) in drive.keyframes.iter().enumerate() {
        live.push(keyframe).unwrap();
        if k % 7 == 6 {
            let arrived = all.iter().enumerate();
            let arrived = arrived.filter(|it| arrives_ns(*it) <= keyframe.stamp_ns);
            let arrived: Vec<GnssFix> = arrived.map(|it| *it.1).collect();
            live.replace_fixes(of_receiver(arrived));
            live.update().unwrap();
        }
    }
    assert!(live.fixes().taken() > 200, "{:?}", live.fixes().counts());
    for keyframe in [0, 150, 299] {
        let error_m = drive.error_m(&mut live, keyframe);
        assert!(error_m < 1.0, "{keyframe}: {error_m}");
    }
    assert!(live.replace_fixes(of_receiver(all.clone())));
    live.update().unwrap();
    assert!(!live.replace_fixes(of_receiver(all.clone())));
    live.solve().unwrap();
    let whole = drive.solved(all);
    assert_eq!(live.poses(), whole.poses());
    assert_eq!(live.positions(), whole.positions());
    // All are taken back.
    assert!(live.replace_fixes(of_receiver(Vec::new())));
    live.update().unwrap();
    assert_eq!(live.positions(), []);
    live.solve().unwrap();
    assert_eq!(live.poses(), drive.solved(Vec::new()).poses());
}

/// Of the fixes around a keyframe the one that is known best is taken, which may be the last one.
#[test]
fn a_fix_that_is_taken_stays_however_late_the_fixes_are() {
    let drive = Drive::new(300, 1);
    let all = drive.fixes(2);
    let mut live = drive.with(Vec::new());
    let mut before = Vec::new();
    for (k, keyframe) in drive.keyframes.iter().enumerate() {
        live.push(keyframe).unwrap();
        let arrived = all.partition_point(|fix| fix.stamp_ns + SECOND_NS / 3 <= keyframe.stamp_ns);
        live.replace_fixes(of_receiver(all[..arrived].to_vec()));
        live.update().unwrap();
        let taken: Vec<_> = live.positions().iter().map(|it| it.position).collect();
        if k > 50 {
            assert!(taken.len() > 40 && taken.starts_with(&before), "{k}");
        }
        before = taken;
    }
    assert!(before.len() > 250, "{}", before.len());
}

/// Returns the solution of all edges of a file by plain least squares.
fn plain(edges: &G2o) -> Vec<Pose> {
    let options = GraphOptions {
        gate: f64::INFINITY,
        kernel: Kernel::None,
        tolerance: 1e-12,
        ..GraphOptions::default()
    };
    let mut graph = PoseGraph::new(edges.poses[0], options);
    for constraint in &edges.constraints {
        graph.apply(constraint).unwrap();
    }
    graph.solve().unwrap();
    graph.poses().to_vec()
}

/// Loops of which groups are dependent and some are wrong by decimetres, fixes with a reflection.
#[test]
fn plain_least_squares_of_the_g2o_file_finds_the_same_poses() {
    let drive = Drive::new(600, 13);
    let mut fixes = drive.fixes(14);
    for fix in fixes.iter_mut().filter(|it| is_reflected(it.stamp_ns)) {
        fix.east_m += 3.0;
    }
    let mut estimator = drive.with(fixes);
    for keyframe in &drive.keyframes {
        estimator.push(keyframe).unwrap();
    }
    for k in 0..60 {
        let [from, to] = [40 + k, 400 + k];
        let off_m = if k % 5 == 4 { 0.3 } else { 0.02 };
        let motion = UncertainMotion {
            motion: drive.truth[from].inv_mul(&drive.truth[to]) * pose(off_m, 0.0, 0.001),
            covariance: 0.01 * Matrix3::from_diagonal(&[1.0, 1.0, 0.01].into()),
        };
        let closing = Constraint::closing(from, to, motion);
        estimator.close_loop(&closing).unwrap();
    }
    estimator.solve().unwrap();
    let text = estimator.g2o();
    let (edges, comments) = text.split_once("FIX 0\n").unwrap();
    let kernel = "# robust kernel: dynamic covariance scaling, phi 4.0665.";
    assert!(comments.starts_with(kernel), "{comments}");
    // Without the comments the fixes are read as loops.
    let all = G2o::parse(edges).unwrap();
    let without_fixes = G2o::parse(&text).unwrap();
    assert_eq!(without_fixes.constraints.len(), 599 + 60);
    assert!(all.constraints.len() > 599 + 60 + 400);
    let apart_m = |a: &[Pose]| {
        let pairs = a.iter().zip(estimator.poses());
        let apart = pairs.map(|(a, b)| (a.translation.vector - b.translation.vector).norm());
        apart.fold(0.0, f64::max)
    };
    assert!(apart_m(&plain(&all)) < 2e-3, "{}", apart_m(&plain(&all)));
    assert!(apart_m(&plain(&without_fixes)) > 0.1);
}
