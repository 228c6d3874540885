use gyre_geometry::{pose, xy_yaw};
use nalgebra::Vector2;
use proptest::prelude::*;
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::StandardNormal;

use super::*;

const INTERVAL_S: f64 = 0.25;
const BIAS_RADPS: f64 = 0.004;
const JITTER_RAD: f64 = 2e-3;

/// Moves the tracker of the radar to a registered heading, and returns it with the reported turn.
fn take(
    heading: &mut Heading,
    at: &mut Pose,
    registered_rad: f64,
    turn: &GyroTurn,
    config: &GyroConfig,
) -> f64 {
    let registered = registered_at(registered_rad);
    let predicted = heading.predict(turn, config);
    heading.update(&registered, at, &predicted);
    let motion = at.inv_mul(&registered.motion);
    *at = registered.motion;
    heading.correct(&motion).rotation.angle()
}

fn registered_at(yaw_rad: f64) -> UncertainMotion {
    UncertainMotion {
        motion: pose(0.0, 0.0, yaw_rad),
        covariance: Matrix3::from_diagonal_element(2.0 * JITTER_RAD * JITTER_RAD),
    }
}

/// The radar's jitter does not stay in the reported heading, nor does the bias of the gyro.
#[test]
fn the_heading_follows_the_radar_and_has_the_noise_of_the_gyro() {
    // A constant turn does not separate the scale from the bias.
    let config = GyroConfig {
        scale_sigma: 0.0,
        ..GyroConfig::default()
    };
    for rate_radps in [0.0, 0.1] {
        let mut heading = Heading::new(&config);
        let (mut at, mut truth, mut reported) = (Pose::identity(), 0.0, 0.0);
        for scan in 0..400 {
            let turn_rad = rate_radps * INTERVAL_S;
            truth += turn_rad;
            let turn = GyroTurn {
                yaw_rad: turn_rad + BIAS_RADPS * INTERVAL_S,
                variance_rad2: 1e-10,
                interval_s: INTERVAL_S,
                sweep_rate_radps: rate_radps + BIAS_RADPS,
            };
            // Noise without a mean, and without a generator.
            let jitter = JITTER_RAD * (f64::from(scan) * 2.4).sin() * 2f64.sqrt();
            let step = take(&mut heading, &mut at, truth + jitter, &turn, &config);
            reported += step;
            assert!(scan < 200 || (step - turn_rad).abs() < 0.25 * JITTER_RAD);
        }
        let sigma_radps = heading.covariance[(BIAS, BIAS)].sqrt();
        let off_radps = (heading.bias_radps - BIAS_RADPS).abs();
        assert!(
            off_radps < 3.0 * sigma_radps && off_radps < 2e-5,
            "{off_radps}"
        );
        assert!(wrap_angle(reported - truth).abs() < 0.3 * JITTER_RAD);
    }
}

/// A motion along the direction of a heading that the registration misses by its jitter is ahead.
#[test]
fn a_reported_motion_is_along_the_heading_of_the_filter() {
    let mut heading = Heading {
        correction_rad: 0.01,
        drift_rad: 0.02,
        ..Heading::new(&GyroConfig::default())
    };
    let first = heading.correct(&Pose::identity());
    assert!((first.rotation.angle() - 0.01).abs() < 1e-12);
    // The filter's heading in the map is 0.03 rad to the left of the tracker's.
    let ahead = Pose::rotation(0.03) * pose(2.0, 0.0, -0.03);
    heading.correction_rad = -0.02;
    let motion = xy_yaw(&heading.correct(&ahead));
    let expected = [2.0, 0.0, -0.03];
    let off: Vec<f64> = motion
        .iter()
        .zip(expected)
        .map(|(a, b)| (a - b).abs())
        .collect();
    assert!(off.iter().all(|off| *off < 1e-12), "{motion:?}");
}

/// The scan that starts a map has no jitter in it, also if an earlier pose was reported last.
#[test]
fn a_motion_from_the_first_scan_of_a_map_is_not_turned_by_the_jitter_in_the_old_map() {
    for moved_rad in [0.0, 0.02] {
        let mut heading = Heading {
            correction_rad: 0.01,
            drift_rad: 0.02,
            ..Heading::new(&GyroConfig::default())
        };
        heading.correct(&Pose::identity());
        // The tracker turns, and the heading does not.
        heading.correction_rad -= moved_rad;
        heading.start_map();
        let motion = heading.correct(&(Pose::rotation(moved_rad) * pose(2.0, 0.0, 0.0)));
        let [_, y_m, yaw_rad] = xy_yaw(&motion);
        assert!(y_m.abs() < 1e-12 && yaw_rad.abs() < 1e-12, "{motion}");
    }
}

#[derive(Debug, Clone, Copy, PartialEq)]
enum Event {
    /// The gyro has measured the turn, and the scan is registered.
    Fused,
    /// The gyro has measured it, and nothing matches.
    Blind,
    /// The scan is registered, and the log has a gap.
    Gap,
    /// Neither: the motions before determine the heading.
    Lost,
}

impl Event {
    fn has_turn(self) -> bool {
        matches!(self, Self::Fused | Self::Blind)
    }

    fn is_registered(self) -> bool {
        matches!(self, Self::Fused | Self::Gap)
    }
}

/// A drive through a map that drifts, with the errors that the filter assumes.
struct Drive {
    rng: ChaCha8Rng,
    config: GyroConfig,
    heading: Heading,
    at: Pose,
    true_rad: f64,
    bias_radps: f64,
    /// Measured turn over the true turn.
    measured: f64,
    drift_rad: f64,
    has_anchor: bool,
    /// The heading by the reported motions.
    reported_rad: f64,
}

impl Drive {
    /// Standard deviation of a turn that is predicted from the motions before, rad.
    const GUESS_RAD: f64 = 0.01;
    /// Variance of a turn that the gyro measures, but for the tilt, rad².
    const TURN_RAD2: f64 = 2.5e-9;
    const STEP_M: f64 = 2.5;

    fn new(seed: u64) -> Self {
        let config = GyroConfig::default();
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let [bias, scale] = [0, 1].map(|_| rng.sample::<f64, _>(StandardNormal));
        Self {
            rng,
            heading: Heading::new(&config),
            bias_radps: bias * config.bias_sigma_radps,
            measured: 1.0 / (1.0 + scale * config.scale_sigma),
            config,
            at: Pose::identity(),
            true_rad: 0.0,
            drift_rad: 0.0,
            has_anchor: seed.is_multiple_of(2),
            reported_rad: 0.0,
        }
    }

    fn normal(&mut self, sigma: f64) -> f64 {
        sigma * self.rng.sample::<f64, _>(StandardNormal)
    }

    fn step(&mut self, event: Event) {
        let turn_rad = self.normal(0.1);
        self.true_rad += turn_rad;
        let predicted_rad = match event.has_turn() {
            true => self.predicted(turn_rad),
            false => {
                self.heading.propagate(INTERVAL_S, &self.config);
                None
            }
        };
        let walk = self.config.bias_walk_radps_per_sqrt_s * INTERVAL_S.sqrt();
        self.bias_radps += self.normal(walk);
        self.drift_rad += self.normal(DRIFT_RAD_PER_SQRT_M * Self::STEP_M.sqrt());
        let registered = self.registered();
        let at = match (event.is_registered(), predicted_rad) {
            (true, Some(turn)) => {
                self.heading.update(&registered, &self.at, &turn);
                registered.motion
            }
            (true, None) => {
                self.heading.reset_to(&registered, &self.at);
                registered.motion
            }
            (false, Some(turn)) => {
                // Without an anchor the tracker's pose does not turn.
                let tracked_rad = if self.has_anchor { turn.yaw_rad } else { 0.0 };
                let at = self.at * pose(Self::STEP_M, 0.0, tracked_rad);
                self.heading.take_prediction(&at, &self.at, &turn);
                at
            }
            (false, None) => {
                self.heading.inflate(Self::GUESS_RAD.powi(2));
                let guessed_rad = turn_rad + self.normal(Self::GUESS_RAD);
                self.at * pose(Self::STEP_M, 0.0, guessed_rad)
            }
        };
        let motion = self.at.inv_mul(&at);
        self.at = at;
        self.reported_rad += self.heading.correct(&motion).rotation.angle();
    }

    fn predicted(&mut self, turn_rad: f64) -> Option<PredictedTurn> {
        let tilt_rad2 = TILT_RAD_PER_SQRT_S.powi(2) * INTERVAL_S;
        let noise_rad = self.normal((Self::TURN_RAD2 + tilt_rad2).sqrt());
        let turn = GyroTurn {
            yaw_rad: (turn_rad + self.bias_radps * INTERVAL_S + noise_rad) * self.measured,
            variance_rad2: Self::TURN_RAD2,
            interval_s: INTERVAL_S,
            sweep_rate_radps: 0.0,
        };
        Some(self.heading.predict(&turn, &self.config))
    }

    fn registered(&mut self) -> UncertainMotion {
        let jitter_rad = self.normal(JITTER_RAD);
        let mut registered = registered_at(self.true_rad + self.drift_rad + jitter_rad);
        registered.motion.translation.vector =
            self.at.translation.vector + Vector2::new(Self::STEP_M, 0.0);
        registered
    }

    /// The squared error of the heading over its variance.
    fn nees(&self) -> f64 {
        let off_rad = wrap_angle(self.true_rad - self.reported_rad);
        off_rad * off_rad / self.heading.covariance[(0, 0)]
    }
}

/// Gaps of the log, and scans that match nothing, come in runs.
fn events(rng: &mut ChaCha8Rng) -> impl Iterator<Item = Event> {
    const ALL: [Event; 4] = [Event::Fused, Event::Blind, Event::Gap, Event::Lost];
    let mut event = Event::Fused;
    let events = (0..120).map(move |scan| {
        if scan > 0 && rng.random::<f64>() < 0.3 {
            event = ALL[rng.random_range(0..ALL.len())];
        }
        event
    });
    events.collect::<Vec<_>>().into_iter()
}

#[test]
fn the_variance_of_the_heading_is_true_through_gaps_of_the_log() {
    let mut sums = [(0.0, 0.0); 4];
    let (mut of_bias, mut of_scale, mut scales_off) = (0.0, 0.0, 0.0);
    const DRIVES: u64 = 300;
    for seed in 0..DRIVES {
        let mut drive = Drive::new(seed);
        for event in events(&mut ChaCha8Rng::seed_from_u64(1000 + seed)) {
            drive.step(event);
            let (sum, count) = &mut sums[event as usize];
            *sum += drive.nees();
            *count += 1.0;
        }
        let off = drive.heading.bias_radps - drive.bias_radps;
        of_bias += off * off / drive.heading.covariance[(BIAS, BIAS)] / DRIVES as f64;
        let off = drive.heading.scale - 1.0 / drive.measured;
        of_scale += off * off / drive.heading.covariance[(SCALE, SCALE)] / DRIVES as f64;
        scales_off += off * off / DRIVES as f64;
    }
    for (event, (sum, count)) in sums.iter().enumerate() {
        let nees = sum / count;
        assert!((0.8..1.25).contains(&nees), "{event}: {nees} of {count}");
    }
    assert!((0.7..1.4).contains(&of_bias), "{of_bias}");
    assert!((0.7..1.4).contains(&of_scale), "{of_scale}");
    // A prior of 1 % has become less than half of that.
    assert!(scales_off.sqrt() < 0.005, "{}", scales_off.sqrt());
}

proptest! {
    /// Whatever is measured in whatever order, the covariance is one.
    #[test]
    fn the_covariance_stays_symmetric_and_positive(
        events in prop::collection::vec(0usize..5, 1..200), seed in 0u64..1000,
    ) {
        let mut drive = Drive::new(seed);
        for event in events {
            match event {
                0 => drive.step(Event::Fused),
                1 => drive.step(Event::Blind),
                2 => drive.step(Event::Gap),
                3 => drive.step(Event::Lost),
                _ => drive.heading.start_map(),
            }
            let covariance = drive.heading.covariance;
            let scale = Matrix4::from_diagonal(&covariance.diagonal().map(|it| 1.0 / it.max(1e-30).sqrt()));
            let correlation = scale * covariance * scale;
            prop_assert!((correlation - correlation.transpose()).norm() < 1e-9, "{covariance}");
            prop_assert!(correlation.symmetric_eigenvalues().min() > -1e-9, "{covariance}");
        }
    }
}
