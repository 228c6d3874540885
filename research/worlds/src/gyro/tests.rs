#![allow(clippy::unwrap_used)]
use gyre_geometry::samples::{Sample, SampleKind, UpAxis};
use gyre_simulator::beside::KINDS;
use nalgebra::{Matrix3, Vector3};
use proptest::prelude::*;

use crate::{config::SimulationConfig, drive::{DriveConfig, DriveKind}, path::BlockLoop, simulator::Simulator, stream::Stream, Effects, Realism, Relief};
use super::*;

const RATE_HZ: f64 = 100.0;

fn exact() -> SimulatedGyroConfig {
    SimulatedGyroConfig {
        profile: GyroProfile::Exact,
        ..SimulatedGyroConfig::default()
    }
}

/// A drive through a town, level or with hills on which the vehicle also pitches and rolls.
fn simulator(gyro: SimulatedGyroConfig, scans: usize, hills: bool) -> Simulator {
    let drive = DriveConfig {
        kind: DriveKind::Town,
        ..DriveConfig::default()
    };
    Simulator::new(&SimulationConfig {
        scans: Some(scans),
        drive,
        gyro,
        effects: Effects {
            elevation: hills,
            hills: Some(hills),
            ..Effects::default()
        },
        realism: Realism::Plain,
        ..SimulationConfig::default()
    })
    .unwrap()
}

fn drive(gyro: SimulatedGyroConfig, scans: usize, hills: bool) -> (Simulator, Vec<Sample>) {
    let simulator = simulator(gyro, scans, hills);
    let samples = simulator.samples(SampleKind::Gyro).unwrap();
    (simulator, samples)
}

/// The integral of the yaw rate less the change of the heading, rad, and that change.
fn heading_error_rad(simulator: &Simulator, samples: &[Sample]) -> (f64, f64) {
    let integral: f64 = samples
        .iter()
        .map(|sample| sample.values[2] / RATE_HZ)
        .sum();
    let step = |index: usize| {
        let at = |index: usize| simulator.path().pose(index as f64 / RATE_HZ).rotation;
        (at(index).inverse() * at(index + 1)).angle()
    };
    let turn: f64 = (0..samples.len()).map(step).sum();
    (integral - turn, turn)
}

fn deviation(values: &[f64]) -> f64 {
    (values.iter().map(|value| value * value).sum::<f64>() / values.len() as f64).sqrt()
}

#[test]
fn an_exact_gyro_on_level_ground_turns_as_the_path_does() {
    let (simulator, samples) = drive(exact(), 300, false);
    let (error_rad, turn_rad) = heading_error_rad(&simulator, &samples);
    assert_eq!(samples.len(), 7500);
    assert!(turn_rad.abs() > 0.5, "the drive turns: {turn_rad} rad");
    assert!(error_rad.abs() < 1e-8, "{error_rad} rad");
    assert!(
        samples
            .iter()
            .all(|s| s.values[0] == 0.0 && s.values[1] == 0.0)
    );
    let lost = samples.iter().map(|s| s.values[5] - 9.80665);
    assert!(lost.into_iter().all(|off| off.abs() < 1e-6), "gravity");
}

#[test]
fn hills_tilt_the_gyro() {
    let (simulator, samples) = drive(exact(), 300, true);
    let (error_rad, turn_rad) = heading_error_rad(&simulator, &samples);
    // A tilt of 2.6 % and one of the springs of 0.8 % take about 4e-4 off a turn.
    let share = (error_rad / turn_rad).abs();
    assert!(
        (1e-6..5e-3).contains(&share),
        "{error_rad} of {turn_rad} rad"
    );
    for axis in [0, 1] {
        let rates: Vec<f64> = samples.iter().map(|sample| sample.values[axis]).collect();
        // 0.008 rad at 0.7 to 2.2 Hz.
        assert!(
            (0.02..0.2).contains(&deviation(&rates)),
            "{}",
            deviation(&rates)
        );
    }
}

/// The heading of each seed after a minute at a rate, less that of an exact gyro, rad.
fn spread_rad(figures: &GyroFigures, rates_radps: Vector3<f64>) -> f64 {
    let motion = MeanMotion {
        rates_radps,
        acceleration_mps2: Vector3::zeros(),
    };
    let error = |seed: u64| {
        let mut rng = Stream::GyroErrors.generator(seed);
        let mut measure = figures.measure(&mut rng, |_| motion);
        let mut rate = || measure(&mut rng, [0.0; 2], false).unwrap()[2];
        let off = (0..6000).map(|_| rate() - rates_radps.z);
        off.sum::<f64>() / RATE_HZ
    };
    deviation(&(0..400).map(error).collect::<Vec<_>>())
}

#[test]
fn each_error_is_as_large_as_its_figure() {
    let none = GyroProfile::Exact.figures().unwrap();
    let level = Vector3::new(0.0, 0.0, 0.2);
    let minute_s = 60.0;
    let cases = [
        (
            "noise",
            GyroFigures {
                noise_rad_per_sqrt_s: 2e-4,
                ..none
            },
            level,
            2e-4 * f64::sqrt(minute_s),
        ),
        (
            "bias",
            GyroFigures {
                bias_sigma_radps: 0.01,
                ..none
            },
            level,
            0.01 * minute_s,
        ),
        (
            "scale",
            GyroFigures {
                scale_sigma: 0.01,
                ..none
            },
            level,
            0.01 * 0.2 * minute_s,
        ),
        (
            "misalignment",
            GyroFigures {
                misalignment_rad: 0.01,
                ..none
            },
            Vector3::new(0.0, 0.1, 0.0),
            0.01 * 0.1 * minute_s,
        ),
        // The integral of a Gauss-Markov process that is much faster: sigma √(2 tau t).
        (
            "drift",
            GyroFigures {
                bias_drift_radps: 1e-3,
                bias_drift_s: 0.5,
                ..none
            },
            level,
            1e-3 * f64::sqrt(2.0 * 0.5 * minute_s),
        ),
    ];
    for (name, figures, rates_radps, expected_rad) in cases {
        let ratio = spread_rad(&figures, rates_radps) / expected_rad;
        assert!((0.88..1.12).contains(&ratio), "{name}: {ratio}");
    }
}

#[test]
fn the_integral_over_a_drive_is_wrong_by_what_the_figures_allow() {
    let of_seed = |seed: u64| {
        let gyro = SimulatedGyroConfig {
            profile: GyroProfile::Bmi088,
            seed: Some(seed),
            misalignment_rad: Some(0.0),
            ..SimulatedGyroConfig::default()
        };
        let figures = gyro.figures().unwrap();
        let (simulator, samples) = drive(gyro, 120, false);
        let (error_rad, turn_rad) = heading_error_rad(&simulator, &samples);
        let time_s = samples.len() as f64 / RATE_HZ;
        let variances = [
            figures.noise_rad_per_sqrt_s * time_s.sqrt(),
            figures.bias_sigma_radps * time_s,
            figures.scale_sigma * turn_rad,
        ];
        error_rad
            / variances
                .iter()
                .map(|sigma| sigma * sigma)
                .sum::<f64>()
                .sqrt()
    };
    let spread = deviation(&(0..30).map(of_seed).collect::<Vec<_>>());
    assert!((0.7..1.3).contains(&spread), "{spread} standard deviations");
}

#[test]
fn rates_are_rounded_to_steps() {
    let step_radps = 0.0043;
    let gyro = SimulatedGyroConfig {
        step_radps: Some(step_radps),
        ..exact()
    };
    let (_, samples) = drive(gyro, 300, false);
    let steps = samples.iter().map(|sample| sample.values[2] / step_radps);
    assert!(
        steps
            .clone()
            .all(|steps| (steps - steps.round()).abs() < 1e-6)
    );
    assert!(
        steps.clone().any(|steps| steps.abs() > 10.0),
        "the drive turns"
    );
}

#[test]
fn one_seed_is_one_log_which_more_scans_extend() {
    let gyro = |seed| SimulatedGyroConfig {
        profile: GyroProfile::Bmi088,
        seed: Some(seed),
        jitter_s: 1e-3,
        lost: 0.1,
        stall_every_s: 5.0,
        stall_s: 0.8,
        ..SimulatedGyroConfig::default()
    };
    let csv = |seed, scans| {
        let records = simulator(gyro(seed), scans, true).records(&KINDS[0]);
        KINDS[0].csv(&records.unwrap())
    };
    let log = csv(3, 40);
    assert_eq!(log, csv(3, 40));
    assert_ne!(log, csv(4, 40));
    assert!(csv(3, 60).starts_with(&log));
}

/// The stamps of a gyro on a block, ns after the start of the drive.
fn stamps_ns(gyro: &SimulatedGyroConfig, seed: u64, end_s: f64) -> Vec<i64> {
    let path = BlockLoop::new(40.0, 32.0, 9.5, 5.0);
    let vehicle = Vehicle::new(&path, Relief::LEVEL, None);
    let records = device(gyro, seed, vehicle).unwrap().records((0, end_s));
    records.into_iter().map(|(stamp_ns, _)| stamp_ns).collect()
}

#[test]
fn the_clock_has_each_fault_in_the_number_that_was_asked_for() {
    // Stamps of 10 000 samples less their times, s, of a host that loses none.
    let late = |gyro: &SimulatedGyroConfig| -> Vec<f64> {
        let stamps_ns = (0_u32..).zip(stamps_ns(gyro, 5, 100.0));
        let late_s = |(index, ns)| ns as f64 * 1e-9 - (f64::from(index) + 0.5) / RATE_HZ;
        stamps_ns.map(late_s).collect()
    };
    let near = |value: f64, expected: f64| (value - expected).abs() < 1e-7;
    assert!(late(&exact()).iter().all(|late_s| near(*late_s, 0.0)));

    let offset = late(&SimulatedGyroConfig {
        late_s: 1.58,
        ..exact()
    });
    assert!(offset.iter().all(|late_s| near(*late_s, 1.58)));

    let drift = late(&SimulatedGyroConfig {
        clock_ppm: 50.0,
        ..exact()
    });
    assert!(near(drift[9_999], 99.995 * 50e-6), "{}", drift[9_999]);

    let jitter = deviation(&late(&SimulatedGyroConfig {
        jitter_s: 1e-3,
        ..exact()
    }));
    assert!((0.97..1.03).contains(&(jitter / 1e-3)), "{jitter}");

    let gyro = SimulatedGyroConfig {
        lost: 0.2,
        ..exact()
    };
    let lost = 10_000 - stamps_ns(&gyro, 5, 100.0).len();
    assert!((1900..2100).contains(&lost), "{lost} of 10 000");

    // Five stalls in 100 s, of 80 samples each, which are stamped together at the end.
    let stalls = late(&SimulatedGyroConfig {
        stall_every_s: 20.0,
        stall_s: 0.8,
        ..exact()
    });
    let stalled: Vec<f64> = stalls.into_iter().filter(|late_s| *late_s > 1e-6).collect();
    let begins = stalled.iter().filter(|late_s| **late_s > 0.79).count();
    assert_eq!(begins, 5, "the first sample of each waits longest");
    let expected = 5 * (80 + 1);
    assert!(
        stalled.len().abs_diff(expected) <= 5,
        "{} of {expected}",
        stalled.len()
    );
}

proptest! {
    #[test]
    fn stamps_never_go_backwards(jitter_s in 0.0..0.1, stall_s in 0.0..3.0, late_s in -2.0..2.0) {
        let clock = SimulatedGyroConfig { jitter_s, stall_s, late_s, stall_every_s: 3.0, ..exact() };
        let stamps = stamps_ns(&clock, 7, 20.0);
        prop_assert!(stamps.windows(2).all(|pair| pair[0] < pair[1]));
    }
}

#[test]
fn the_named_axis_points_up_and_axes_are_right_handed() {
    use UpAxis::{MinusX, MinusY, MinusZ, X, Y, Z};
    for up in [X, MinusX, Y, MinusY, Z, MinusZ] {
        assert_eq!(up.in_vehicle(in_axes(up, [0.1, 0.2, 0.3]))[2], 0.3);
        let columns = [Vector3::x(), Vector3::y(), Vector3::z()];
        let columns = columns.map(|axis| Vector3::from(in_axes(up, axis.into())));
        let determinant = Matrix3::from_columns(&columns).determinant();
        assert!((determinant - 1.0).abs() < 1e-12, "{up:?}");
    }
}

#[test]
fn a_value_that_cannot_be_simulated_is_named() {
    let key = |gyro: SimulatedGyroConfig| gyro.validate().unwrap_err().to_string();
    let config = exact();
    assert!(
        key(SimulatedGyroConfig {
            rate_hz: Some(0.0),
            ..config.clone()
        })
        .contains("`gyro.rate_hz` is 0")
    );
    assert!(
        key(SimulatedGyroConfig {
            lost: f64::NAN,
            ..config.clone()
        })
        .contains("`gyro.lost` is NaN")
    );
    assert!(
        key(SimulatedGyroConfig {
            stall_s: 1.0,
            ..config
        })
        .contains("`gyro.stall_s` is 1")
    );
    let unknown = toml::from_str::<SimulatedGyroConfig>("profile = \"bmi089\"").unwrap_err();
    assert!(unknown.to_string().contains("bmi088"), "{unknown}");
}
