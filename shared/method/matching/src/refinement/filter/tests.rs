use gyre_geometry::{pose, xy_yaw};
use proptest::prelude::*;
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::StandardNormal;

use super::*;

const INTERVAL_S: f64 = 0.25;

fn gyro() -> SharedErrors {
    SharedErrors::of_gyro(&GyroConfig::default())
}

fn wheels() -> SharedErrors {
    SharedErrors::of(&SensorConfigs::default())[Witness::Wheels as usize]
}

#[derive(Debug, Clone, Copy, PartialEq)]
enum Event {
    /// The sensor has measured the change, and the scan is registered.
    Fused,
    /// The sensor has measured it, and nothing matches.
    Blind,
    /// The scan is registered, and the log has a gap.
    Gap,
    /// Neither: the motions before determine the coordinate.
    Lost,
}

impl Event {
    fn is_measured(self) -> bool {
        matches!(self, Self::Fused | Self::Blind)
    }

    fn is_registered(self) -> bool {
        matches!(self, Self::Fused | Self::Gap)
    }
}

/// A drive through a map that drifts, with the errors that the filter assumes.
struct Drive {
    rng: ChaCha8Rng,
    errors: SharedErrors,
    filter: Filter,
    /// The true coordinate, and the tracker's in the map.
    truth: f64,
    at: f64,
    bias: f64,
    /// Measured change over the true change.
    measured: f64,
    drift: f64,
    /// Standard deviations of jitter, of drift in a step, of a measurement, and of a guess.
    jitter: f64,
    drifts: f64,
    noise: f64,
    guess: f64,
    has_anchor: bool,
}

impl Drive {
    fn new(errors: SharedErrors, seed: u64) -> Self {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let [bias, scale] = [0, 1].map(|_| rng.sample::<f64, _>(StandardNormal));
        let is_gyro = errors.bias_sigma > 0.0;
        Self {
            rng,
            filter: Filter::new(&errors),
            truth: 0.0,
            at: 0.0,
            bias: bias * errors.bias_sigma,
            measured: 1.0 / (1.0 + scale * errors.scale_sigma),
            drift: 0.0,
            jitter: if is_gyro { 2e-3 } else { 0.04 },
            drifts: if is_gyro { 8e-5 } else { 0.02 },
            noise: if is_gyro { 2.5e-4 } else { 0.016 },
            guess: if is_gyro { 0.01 } else { 0.3 },
            has_anchor: seed.is_multiple_of(2),
            errors,
        }
    }

    fn normal(&mut self, sigma: f64) -> f64 {
        sigma * self.rng.sample::<f64, _>(StandardNormal)
    }

    /// Drives so far, and returns the measurement.
    fn drive(&mut self, change: f64) -> Evidence {
        self.truth += change;
        let off = self.bias * INTERVAL_S + self.normal(self.noise);
        Evidence {
            samples: 1,
            interval_s: INTERVAL_S,
            value: [(change + off) * self.measured, 0.0],
            covariance: [self.noise.powi(2), 0.0, 0.0],
        }
    }

    fn predict(&mut self, measured: &Evidence) -> Predicted {
        self.filter.wait(INTERVAL_S, &self.errors);
        self.bias += self.normal(self.errors.bias_walk_per_sqrt_s * INTERVAL_S.sqrt());
        self.filter.predict(measured)
    }

    fn register(&mut self) -> Seen {
        self.drift += self.normal(self.drifts);
        let seen = self.truth + self.drift + self.normal(self.jitter);
        let change = seen - self.at;
        self.at = seen;
        Seen {
            change,
            jitter: self.jitter.powi(2),
            drift: self.drifts.powi(2),
        }
    }

    fn step(&mut self, event: Event, change: f64) {
        let measured = self.drive(change);
        let predicted = self.predict(&measured);
        match (event.is_registered(), event.is_measured()) {
            (true, true) => {
                let seen = self.register();
                self.filter.update(&seen, &predicted);
            }
            (true, false) => {
                let seen = self.register();
                self.filter.reset_to(&seen);
            }
            (false, true) => {
                // Without an anchor the tracker's pose does not move.
                let tracked = if self.has_anchor {
                    predicted.in_map
                } else {
                    0.0
                };
                self.at += tracked;
                self.filter.take_prediction(tracked, &predicted);
            }
            (false, false) => {
                self.at += change + self.normal(self.guess);
                self.filter.inflate(self.guess.powi(2));
            }
        }
    }

    /// A step with a certain match; returns whether the sensor, which is off by `slip`, is used.
    fn judged_step(&mut self, change: f64, slip: f64) -> bool {
        let mut measured = self.drive(change);
        measured.value[0] += slip;
        let predicted = self.predict(&measured);
        let seen = self.register();
        self.filter
            .judge(&seen, Some(&predicted), true, &self.errors);
        self.filter.verdict == Verdict::Agrees
    }

    /// The squared error of the coordinate over its variance, and the same in the map.
    fn nees(&self) -> [f64; 2] {
        let off = self.truth - self.at - self.filter.correction;
        let in_map = off + self.drift - self.filter.drift;
        let of_map = (SEEN * self.filter.covariance * SEEN.transpose())[0];
        [
            off * off / self.filter.covariance[(VALUE, VALUE)],
            in_map * in_map / of_map,
        ]
    }
}

/// Gaps of the log, and scans that match nothing, come in runs.
fn events(seed: u64) -> Vec<Event> {
    const ALL: [Event; 4] = [Event::Fused, Event::Blind, Event::Gap, Event::Lost];
    let mut rng = ChaCha8Rng::seed_from_u64(1000 + seed);
    let mut event = Event::Fused;
    let next = |scan| {
        if scan > 0 && rng.random::<f64>() < 0.3 {
            event = ALL[rng.random_range(0..ALL.len())];
        }
        event
    };
    (0..120).map(next).collect()
}

#[test]
fn the_variances_are_true_through_gaps_of_the_log() {
    const DRIVES: u64 = 300;
    for (errors, step, scale_off) in [(gyro(), 0.1, 0.005), (wheels(), 2.5, 0.004)] {
        let mut sums = [[0.0; 3]; 4];
        let (mut of_bias, mut of_scale, mut scales_off) = (0.0, 0.0, 0.0);
        for seed in 0..DRIVES {
            let mut drive = Drive::new(errors, seed);
            for event in events(seed) {
                let change = drive.normal(step);
                drive.step(event, change);
                let [alone, in_map] = drive.nees();
                let sum = &mut sums[event as usize];
                *sum = [sum[0] + alone, sum[1] + in_map, sum[2] + 1.0];
            }
            let (filter, mean) = (&drive.filter, 1.0 / DRIVES as f64);
            if errors.bias_sigma > 0.0 {
                let off = filter.bias - drive.bias;
                of_bias += off * off / filter.covariance[(BIAS, BIAS)] * mean;
            }
            let off = filter.scale - 1.0 / drive.measured;
            of_scale += off * off / filter.covariance[(SCALE, SCALE)] * mean;
            scales_off += off * off * mean;
        }
        for (event, [alone, in_map, count]) in sums.iter().enumerate() {
            for nees in [alone / count, in_map / count] {
                assert!((0.75..1.3).contains(&nees), "{event}: {nees} of {count}");
            }
        }
        assert!(
            errors.bias_sigma == 0.0 || (0.7..1.4).contains(&of_bias),
            "{of_bias}"
        );
        assert!((0.7..1.4).contains(&of_scale), "{of_scale}");
        assert!(scales_off.sqrt() < scale_off, "{}", scales_off.sqrt());
    }
}

/// A drive with an absolute heading beside the gyro, with white noise and a constant offset.
#[test]
fn an_absolute_heading_bounds_the_error_of_the_heading() {
    const NOISE_RAD: f64 = 0.009;
    let (mut nees, mut with, mut without) = (0.0, 0.0, 0.0);
    for seed in 0..200 {
        let [mut drive, mut alone] = [(); 2].map(|()| Drive::new(gyro(), seed));
        let offset_rad = 3.0 - 0.03 * seed as f64;
        for event in events(seed).into_iter().cycle().take(1200) {
            let change = drive.normal(0.1);
            drive.step(event, change);
            let heading = drive.truth + offset_rad + drive.normal(NOISE_RAD);
            let measured = Evidence {
                value: [wrap_angle(heading), 0.0],
                covariance: [NOISE_RAD.powi(2), 0.0, 0.0],
                ..Evidence::default()
            };
            drive.filter.observe(&measured, drive.at);
            let change = alone.normal(0.1);
            alone.step(event, change);
        }
        let off = |drive: &Drive| drive.truth - drive.at - drive.filter.correction;
        nees += drive.nees()[0] / 200.0;
        with += off(&drive).powi(2) / 200.0;
        without += off(&alone).powi(2) / 200.0;
    }
    assert!((0.6..1.5).contains(&nees), "{nees}");
    assert!(with < 0.1 * without, "{with} {without}");
}

/// Antennas that had no fix at first.
#[test]
fn an_offset_that_was_wrong_is_learnt_again() {
    let mut drive = Drive::new(gyro(), 2);
    for scan in 0..200 {
        drive.step(Event::Fused, 0.03);
        let offset_rad = if scan < 3 { 1.0 } else { 0.0 };
        let measured = Evidence {
            value: [wrap_angle(drive.truth + offset_rad), 0.0],
            covariance: [1e-6, 0.0, 0.0],
            ..Evidence::default()
        };
        drive.filter.observe(&measured, drive.at);
    }
    assert!(drive.filter.offset_verdict == Verdict::Agrees && drive.filter.offset_rad.abs() < 0.1);
}

#[test]
fn a_heading_that_turns_the_other_way_is_refused() {
    let mut drive = Drive::new(gyro(), 1);
    let mut refused = 0;
    for _ in 0..200 {
        drive.step(Event::Fused, 0.03);
        let measured = Evidence {
            value: [wrap_angle(-drive.truth), 0.0],
            covariance: [1e-4, 0.0, 0.0],
            ..Evidence::default()
        };
        drive.filter.observe(&measured, drive.at);
        refused += usize::from(drive.filter.offset_verdict == Verdict::Refused);
    }
    assert!(refused > 150, "{refused}");
}

/// The radar's jitter does not stay in the heading, nor does the bias of the gyro.
#[test]
fn the_coordinate_follows_the_radar_and_has_the_noise_of_the_sensor() {
    // A constant turn does not separate the scale from the bias.
    let errors = SharedErrors {
        scale_sigma: 0.0,
        ..gyro()
    };
    for rate_radps in [0.0, 0.1] {
        let mut drive = Drive::new(errors, 7);
        (drive.noise, drive.drifts) = (1e-5, 0.0);
        let heading = |drive: &Drive| drive.at + drive.filter.correction;
        for scan in 0..400 {
            let (turn, before) = (rate_radps * INTERVAL_S, heading(&drive));
            drive.step(Event::Fused, turn);
            let step = heading(&drive) - before;
            assert!(scan < 200 || (step - turn).abs() < 0.35 * drive.jitter);
        }
        let sigma_radps = drive.filter.covariance[(BIAS, BIAS)].sqrt();
        let off_radps = (drive.filter.bias - drive.bias).abs();
        assert!(
            off_radps < 3.0 * sigma_radps && off_radps < 2e-4,
            "{off_radps}"
        );
        assert!((heading(&drive) - drive.truth).abs() < 0.6 * drive.jitter);
    }
}

/// A motion along the direction of a heading that the registration misses by its jitter is ahead.
#[test]
fn a_reported_motion_is_along_the_heading_of_the_filter() {
    let mut heading = Filter {
        correction: 0.01,
        drift: 0.02,
        ..Filter::new(&gyro())
    };
    let first = heading.correct(&Pose::identity());
    assert!((first.rotation.angle() - 0.01).abs() < 1e-12);
    // The filter's heading in the map is 0.03 rad to the left of the tracker's.
    let ahead = Pose::rotation(0.03) * pose(2.0, 0.0, -0.03);
    heading.correction = -0.02;
    let motion = xy_yaw(&heading.correct(&ahead));
    let mut off = motion
        .iter()
        .zip([2.0, 0.0, -0.03])
        .map(|(a, b)| (a - b).abs());
    assert!(off.all(|off| off < 1e-12), "{motion:?}");
}

/// The scan that starts a map has no jitter in it, also if an earlier pose was reported last.
#[test]
fn a_motion_from_the_first_scan_of_a_map_is_not_turned_by_the_jitter_in_the_old_map() {
    for moved_rad in [0.0, 0.02] {
        let mut heading = Filter {
            correction: 0.01,
            drift: 0.02,
            ..Filter::new(&gyro())
        };
        heading.correct(&Pose::identity());
        // The tracker turns, and the heading does not.
        heading.correction -= moved_rad;
        heading.start_map();
        let motion = heading.correct(&(Pose::rotation(moved_rad) * pose(2.0, 0.0, 0.0)));
        let [_, y_m, yaw_rad] = xy_yaw(&motion);
        assert!(y_m.abs() < 1e-12 && yaw_rad.abs() < 1e-12, "{motion}");
    }
}

#[test]
fn a_sensor_that_is_right_is_rarely_refused() {
    let mut refused = 0;
    for (errors, step) in [(gyro(), 0.1), (wheels(), 2.5)] {
        for seed in 0..150 {
            let mut drive = Drive::new(errors, seed);
            for _ in 0..120 {
                let change = drive.normal(step);
                refused += usize::from(!drive.judged_step(change, 0.0));
            }
        }
    }
    assert!(
        refused <= 12,
        "{refused} of 36 000 by four standard deviations"
    );
}

#[test]
fn wheels_that_slip_are_not_used_until_they_agree_again() {
    let mut drive = Drive::new(wheels(), 3);
    (0..40).for_each(|_| assert!(drive.judged_step(2.5, 0.0)));
    let scale = drive.filter.scale;
    assert!(!drive.judged_step(2.5, 0.8));
    assert_eq!(drive.filter.scale, scale);
    assert!(drive.judged_step(2.5, 0.0));
}

/// Wheels that turn 30 % too fast while the vehicle pulls away: each motion alone is within the
/// noise of a match.
#[test]
fn wheels_that_slip_from_the_first_metre_are_noticed_and_their_scale_is_learnt_again() {
    for seed in 0..100 {
        let mut drive = Drive::new(wheels(), seed);
        let steps = (1..=30).map(|scan| 0.03 * f64::from(scan));
        let refused = steps.filter(|step_m| !drive.judged_step(*step_m, 0.3 * step_m));
        assert!(refused.count() > 0, "{seed}");
        for _ in 0..20 {
            drive.judged_step(2.5, 0.0);
        }
        let off = (drive.filter.scale - 1.0 / drive.measured).abs();
        assert!(off < 0.015, "{seed}: {off}");
    }
}

/// A tachometer that shows 11 % too much, contrary to the settings, is not learnt in silence.
#[test]
fn wheels_of_another_scale_than_the_settings_allow_slip_again_and_again() {
    for seed in 0..100 {
        let mut drive = Drive::new(wheels(), seed);
        drive.measured = 1.0 / 0.9;
        let refused = (0..100).filter(|_| !drive.judged_step(2.5, 0.0)).count();
        assert!(refused > 30, "{seed}: {refused}");
    }
}

#[test]
fn a_new_map_starts_where_the_last_scan_is() {
    let mut drive = Drive::new(wheels(), 5);
    for event in [Event::Fused, Event::Fused, Event::Blind] {
        drive.step(event, 2.5);
    }
    drive.filter.start_map();
    assert_eq!(drive.filter.jitter(), 0.0);
    let of_map = (SEEN * drive.filter.covariance * SEEN.transpose())[0];
    assert!(of_map.abs() < 1e-12 && drive.filter.covariance[(SCALE, SCALE)] > 0.0);
}

proptest! {
    /// Whatever is measured in whatever order, the covariance is one.
    #[test]
    fn the_covariance_stays_symmetric_and_positive(
        events in prop::collection::vec(0usize..5, 1..200), seed in 0u64..1000,
    ) {
        let mut drive = Drive::new(if seed % 3 == 0 { wheels() } else { gyro() }, seed);
        for event in events {
            let change = drive.normal(0.1);
            match event {
                0 => drive.step(Event::Fused, change),
                1 => drive.step(Event::Blind, change),
                2 => drive.step(Event::Gap, change),
                3 => drive.step(Event::Lost, change),
                _ => drive.filter.start_map(),
            }
            let covariance = drive.filter.covariance;
            let scale = Matrix5::from_diagonal(&covariance.diagonal().map(|it| 1.0 / it.max(1e-30).sqrt()));
            let correlation = scale * covariance * scale;
            prop_assert!((correlation - correlation.transpose()).norm() < 1e-9, "{covariance}");
            prop_assert!(correlation.symmetric_eigenvalues().min() > -1e-9, "{covariance}");
        }
    }
}
