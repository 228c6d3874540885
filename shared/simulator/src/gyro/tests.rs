use gyre_geometry::samples::Sample;
use nalgebra::Vector3;

use super::{
    log::{self, Clock, Errors, MeanMotion},
    *,
};
use crate::{config::SimulationConfig, simulator::Simulator};

const RATE_HZ: f64 = 100.0;

fn drive(profile: GyroProfile, faults: bool, scans: usize) -> (Simulator, Vec<Sample>) {
    let gyro = SimulatedGyroConfig {
        profile,
        faults,
        ..SimulatedGyroConfig::default()
    };
    let config = SimulationConfig {
        scans: Some(scans),
        gyro,
        ..SimulationConfig::default()
    };
    let simulator = Simulator::new(&config).unwrap();
    let (path, span) = (simulator.path(), simulator.span());
    let samples = log::samples(&config.gyro, config.seed, path, span).unwrap();
    (simulator, samples)
}

fn deviation(values: &[f64]) -> f64 {
    (values.iter().map(|value| value * value).sum::<f64>() / values.len() as f64).sqrt()
}

#[test]
fn an_exact_gyro_turns_as_the_path_does() {
    let (simulator, samples) = drive(GyroProfile::Exact, false, 100);
    assert_eq!(samples.len(), 2500);
    let integral_rad: f64 = samples.iter().map(|it| it.values[2] / RATE_HZ).sum();
    let at = |index: usize| simulator.path().pose(index as f64 / RATE_HZ).rotation;
    let steps = (0..samples.len()).map(|index| at(index).rotation_to(&at(index + 1)).angle());
    let turn_rad: f64 = steps.sum();
    assert!(turn_rad > 6.0, "a lap: {turn_rad} rad");
    assert!((integral_rad - turn_rad).abs() < 1e-5, "{integral_rad} rad");
    let gravity = samples.iter().map(|it| it.values[5] - 9.80665);
    assert!(gravity.into_iter().all(|off| off.abs() < 1e-6));
    let to_the_left = samples.iter().map(|it| it.values[4]).fold(0.0, f64::max);
    assert!((3.0..7.0).contains(&to_the_left), "{to_the_left} m/s²");
}

#[test]
fn each_error_is_as_large_as_its_figure() {
    let none = GyroProfile::Exact.figures().unwrap();
    let minute_s = 60.0;
    let noise = GyroFigures {
        noise_rad_per_sqrt_s: 2e-4,
        ..none
    };
    let bias = GyroFigures {
        bias_sigma_radps: 0.01,
        ..none
    };
    let scale = GyroFigures {
        scale_sigma: 0.01,
        ..none
    };
    // The integral of a Gauss-Markov process that is much faster: sigma √(2 tau t).
    let drift = GyroFigures {
        bias_drift_radps: 1e-3,
        bias_drift_s: 0.5,
        ..none
    };
    for (name, figures, expected_rad) in [
        ("noise", noise, 2e-4 * f64::sqrt(minute_s)),
        ("bias", bias, 0.01 * minute_s),
        ("scale", scale, 0.01 * 0.2 * minute_s),
        ("drift", drift, 1e-3 * f64::sqrt(minute_s)),
    ] {
        let motion = MeanMotion {
            rates_radps: Vector3::new(0.0, 0.0, 0.2),
            acceleration_mps2: Vector3::zeros(),
        };
        let error_rad = |seed: u64| {
            let mut errors = Errors::new(&figures, seed);
            let off = (0..6000).map(|_| errors.measure(&motion)[2] - 0.2);
            off.sum::<f64>() / RATE_HZ
        };
        let ratio = deviation(&(0..400).map(error_rad).collect::<Vec<_>>()) / expected_rad;
        assert!((0.88..1.12).contains(&ratio), "{name}: {ratio}");
    }
}

#[test]
fn the_numbers_of_the_file_are_those_of_the_samples_which_more_scans_extend() {
    let (_, samples) = drive(GyroProfile::Asm330lhh, true, 20);
    let text = log::csv(&samples);
    let rows: Vec<&str> = text.lines().skip(1).collect();
    assert_eq!(rows.len(), samples.len());
    for (row, sample) in rows.iter().zip(&samples) {
        let fields: Vec<&str> = row.split(',').collect();
        assert_eq!(fields[0].parse(), Ok(sample.stamp_ns));
        for (field, value) in fields[1..].iter().zip(sample.values) {
            assert_eq!(field.parse(), Ok(value));
        }
    }
    let longer = log::csv(&drive(GyroProfile::Asm330lhh, true, 30).1);
    assert!(longer.starts_with(&text));
}

#[test]
fn a_clock_is_late_and_with_faults_loses_samples_and_stalls() {
    let delay_s = |faults: bool| -> Vec<f64> {
        let config = SimulatedGyroConfig {
            delay_s: 1.5,
            faults,
            ..SimulatedGyroConfig::default()
        };
        let mut clock = Clock::new(&config, 5);
        let times = (0..10_000).map(|index| f64::from(index) / RATE_HZ);
        times
            .filter_map(|time_s| Some(clock.stamp_ns(time_s)? as f64 * 1e-9 - time_s))
            .collect()
    };
    let good = delay_s(false);
    assert_eq!(good.len(), 10_000);
    assert!(good.iter().all(|delay_s| (delay_s - 1.5).abs() < 1e-7));
    let faulty = delay_s(true);
    assert!((9_720..9_880).contains(&faulty.len()), "{}", faulty.len());
    // 50 stalls of 6 samples.
    let stalled = faulty
        .iter()
        .filter(|delay_s| **delay_s > 1.5 + 1e-6)
        .count();
    assert!((250..400).contains(&stalled), "{stalled}");
}
