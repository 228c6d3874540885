use nalgebra::Matrix3;
use proptest::prelude::*;
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::StandardNormal;

use super::*;

const INTERVAL_S: f64 = 0.25;
const BIAS_RADPS: f64 = 0.004;
/// Standard deviation of registered headings, rad.
const NOISE_RAD: f64 = 2e-3;

/// Weighs a drive of `scans` scans that turns at a rate, with a gyro that has a bias. Each scan
/// becomes a keyframe, unless the vehicle stands.
fn drive(scans: u32, rate_radps: f64, keyframes: Option<usize>) -> (Heading, f64) {
    // A constant turn does not separate the scale from the bias.
    let config = GyroConfig {
        scale_sigma: 0.0,
        ..GyroConfig::default()
    };
    let mut heading = Heading::new(&config);
    let (mut at, mut truth) = (Pose::identity(), 0.0);
    for scan in 0..scans {
        truth += rate_radps * INTERVAL_S;
        let turn = GyroTurn {
            yaw_rad: (rate_radps + BIAS_RADPS) * INTERVAL_S,
            variance_rad2: 1e-10,
            interval_s: INTERVAL_S,
            sweep_rate_radps: rate_radps + BIAS_RADPS,
        };
        // Noise without a mean, and without a generator.
        let noise = NOISE_RAD * (f64::from(scan) * 2.4).sin() * 2f64.sqrt();
        let registered = UncertainMotion {
            motion: pose(0.0, 0.0, truth + noise),
            covariance: Matrix3::from_diagonal_element(NOISE_RAD * NOISE_RAD),
        };
        let predicted = heading.predict(&turn, &config);
        at = heading.update(&registered, &at, &predicted, 0.1).motion;
        if let Some(keyframes) = keyframes {
            heading.add_keyframe(keyframes);
        }
    }
    (heading, wrap_angle(at.rotation.angle() - truth))
}

#[test]
fn a_standing_vehicle_shows_the_bias() {
    let (heading, off_rad) = drive(120, 0.0, None);
    let off_radps = heading.bias_radps - BIAS_RADPS;
    assert!(off_radps.abs() < 2e-5, "{off_radps} rad/s");
    assert!(off_rad.abs() < 5e-4, "{off_rad} rad");
    let sigma_radps = heading.covariance[(1, 1)].sqrt();
    assert!(off_radps.abs() < 3.0 * sigma_radps, "{sigma_radps} rad/s");
}

#[test]
fn on_the_road_the_bias_is_never_better_known_than_the_radar_leans() {
    let [stood, driven] = [None, Some(10)].map(|keyframes| {
        let (heading, off_rad) = drive(400, 0.1, keyframes);
        assert!(off_rad.abs() < 2.0 * NOISE_RAD, "{off_rad} rad");
        heading.covariance[(1, 1)].sqrt()
    });
    // A map of ten keyframes follows the yaw_bias by 2/11 a scan.
    let floor_radps = YAW_BIAS_SIGMA_RAD * 2.0 / 11.0 / INTERVAL_S;
    assert!(
        driven > floor_radps && driven > 2.0 * stood,
        "{driven}, {stood} rad/s"
    );
}

#[test]
fn the_place_moves_along_with_the_heading() {
    let config = GyroConfig::default();
    let mut heading = Heading::new(&GyroConfig {
        bias_sigma_radps: 0.0,
        ..config.clone()
    });
    let turn = GyroTurn {
        interval_s: INTERVAL_S,
        variance_rad2: 1e-12,
        ..GyroTurn::default()
    };
    // Along the axes of the scan before, which looks to the left.
    let previous = pose(0.0, 0.0, std::f64::consts::FRAC_PI_2);
    let covariance = Matrix3::new(1.0, 0.0, 0.5, 0.0, 1.0, 0.0, 0.5, 0.0, 1.0) * 1e-4;
    let registered = UncertainMotion {
        motion: pose(0.0, 2.0, previous.rotation.angle() + 0.01),
        covariance,
    };
    let predicted = heading.predict(&turn, &config);
    let fused = heading.update(&registered, &previous, &predicted, 1.0);
    let [x_m, y_m, yaw_rad] = xy_yaw(&fused.motion);
    let off = [x_m, y_m - 1.995, yaw_rad - previous.rotation.angle()];
    assert!(off.iter().all(|off| off.abs() < 1e-4), "{off:?}");
    let by_gyro_rad2 = TILT_RAD_PER_SQRT_S.powi(2) * INTERVAL_S;
    assert!(fused.covariance[(2, 2)] < 1.01 * by_gyro_rad2);
    assert!(fused.covariance[(0, 0)] < 0.8e-4);
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

/// A drive through a map that stays, with the errors that the filter assumes.
struct Drive {
    rng: ChaCha8Rng,
    config: GyroConfig,
    heading: Heading,
    at: Pose,
    true_rad: f64,
    bias_radps: f64,
    /// Measured turn over the true one.
    measured: f64,
    yaw_bias_rad: f64,
}

impl Drive {
    /// Standard deviation of a turn that is predicted from the motions before, rad.
    const GUESS_RAD: f64 = 0.01;
    /// Variance of a turn that the gyro measures, but for the tilt, rad².
    const TURN_RAD2: f64 = 2.5e-9;

    fn new(seed: u64) -> Self {
        let config = GyroConfig::default();
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let [bias, yaw_bias, scale] = [0, 1, 2].map(|_| rng.sample::<f64, _>(StandardNormal));
        Self {
            rng,
            heading: Heading::new(&config),
            bias_radps: bias * config.bias_sigma_radps,
            measured: 1.0 / (1.0 + scale * config.scale_sigma),
            config,
            at: Pose::identity(),
            true_rad: 0.0,
            yaw_bias_rad: yaw_bias * YAW_BIAS_SIGMA_RAD,
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
        let kept = (-INTERVAL_S / YAW_BIAS_TIME_S).exp();
        let fresh = self.normal(YAW_BIAS_SIGMA_RAD * (1.0 - kept * kept).sqrt());
        self.yaw_bias_rad = kept * self.yaw_bias_rad + fresh;
        let registered = self.registered();
        self.at = match (event.is_registered(), predicted_rad) {
            (true, Some(turn)) => {
                self.heading
                    .update(&registered, &self.at, &turn, 0.1)
                    .motion
            }
            (true, None) => self.heading.reset_to(&registered, &self.at).motion,
            (false, Some(turn)) => self.at * pose(0.0, 0.0, turn.yaw_rad),
            (false, None) => {
                self.heading.inflate(Self::GUESS_RAD.powi(2));
                let guessed_rad = turn_rad + self.normal(Self::GUESS_RAD);
                self.at * pose(0.0, 0.0, guessed_rad)
            }
        };
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
        let noise_rad = self.normal(NOISE_RAD);
        UncertainMotion {
            motion: pose(0.0, 0.0, self.true_rad + self.yaw_bias_rad + noise_rad),
            covariance: Matrix3::from_diagonal_element(NOISE_RAD * NOISE_RAD),
        }
    }

    /// The squared error of the heading over its variance.
    fn nees(&self) -> f64 {
        let off_rad = wrap_angle(self.true_rad - self.at.rotation.angle());
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
        events in prop::collection::vec(0usize..6, 1..200), seed in 0u64..1000,
    ) {
        let mut drive = Drive::new(seed);
        for event in events {
            match event {
                0 => drive.step(Event::Fused),
                1 => drive.step(Event::Blind),
                2 => drive.step(Event::Gap),
                3 => drive.step(Event::Lost),
                4 => drive.heading.add_keyframe(10),
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
