//! Each kind of sensor: its errors, its faults, its log.

use std::f64::consts::PI;

use gyre_geometry::{
    samples::{Geographic, LocalPlane},
    wrap_angle,
};
use nalgebra::{Vector2, Vector3};

use super::{gyro::*, *};
use crate::{Simulator, stream::Stream};

const RATE_HZ: f64 = 100.0;

/// The drive of a configuration, and the records of all kinds.
fn simulated(settings: &str) -> (Simulator, [Option<Vec<Record>>; 4]) {
    let config: crate::SimulationConfig = toml::from_str(settings).unwrap();
    let simulator = Simulator::new(&config).unwrap();
    let records = KINDS.map(|kind| simulator.records(&kind));
    (simulator, records)
}

fn deviation(values: &[f64]) -> f64 {
    (values.iter().map(|value| value * value).sum::<f64>() / values.len() as f64).sqrt()
}

#[test]
fn each_kind_measures_the_drive_and_a_drive_without_it_has_no_log() {
    let (simulator, [gyro, wheels, gnss, heading]) = simulated(
        "scans = 1600\ngyro.profile = 'exact'\nwheels.rate_hz = 50.0\ngnss.rate_hz = 5.0\n\
        heading = {rate_hz = 10.0, noise_deg = 0.3, offset_deg = 170.0, delay_s = 0.5}",
    );
    let (gyro, wheels, gnss) = (gyro.unwrap(), wheels.unwrap(), gnss.unwrap());
    assert_eq!(
        [gyro.len(), wheels.len(), gnss.len()],
        [40_000, 20_000, 2000]
    );
    let pose = |time_s: f64| simulator.path().pose(time_s);

    let lap = &gyro[..2500];
    let integral_rad: f64 = lap.iter().map(|it| it.1[2] / RATE_HZ).sum();
    let at = |index: usize| pose(index as f64 / RATE_HZ).rotation;
    let turn = |index: usize| at(index).rotation_to(&at(index + 1)).angle();
    let turn_rad: f64 = (0..lap.len()).map(turn).sum();
    assert!(turn_rad > 6.0, "a lap: {turn_rad} rad");
    assert!((integral_rad - turn_rad).abs() < 1e-5, "{integral_rad} rad");
    assert!(lap.iter().all(|it| (it.1[5] - 9.80665).abs() < 1e-6));
    let to_the_left = lap.iter().map(|it| it.1[4]).fold(0.0, f64::max);
    assert!((3.0..7.0).contains(&to_the_left), "{to_the_left} m/s²");

    // Tyres are a percent off.
    let measured_m: f64 = wheels[..500].iter().map(|it| it.1[0] / 50.0).sum();
    let place = |ms: usize| pose(ms as f64 * 1e-3).translation.vector;
    let driven_m: f64 = (0..10_000)
        .map(|ms| (place(ms + 1) - place(ms)).norm())
        .sum();
    let ratio = measured_m / driven_m;
    assert!((ratio - 1.0).abs() < 0.04, "{measured_m} {driven_m}");

    let plane = LocalPlane::new(gnss::ORIGIN, 0.0);
    let square_m2 = |(stamp_ns, [latitude_deg, longitude_deg, ..]): &Record| {
        let truth = pose((stamp_ns - simulator.span().0) as f64 * 1e-9)
            .translation
            .vector;
        let measured = plane.east_north(Geographic {
            latitude_deg: *latitude_deg,
            longitude_deg: *longitude_deg,
        });
        (Vector2::from(measured) - truth).norm_squared()
    };
    let mean_m2 = gnss.iter().map(square_m2).sum::<f64>() / gnss.len() as f64;
    let stated_m2 = 2.0 * gnss[0].1[3].powi(2);
    assert!((0.3..3.0).contains(&(mean_m2 / stated_m2)), "{mean_m2}");

    let off_rad = |(stamp_ns, [heading_rad, ..]): &Record| {
        let truth = pose((stamp_ns - simulator.span().0) as f64 * 1e-9 - 0.5).rotation;
        wrap_angle(heading_rad - truth.angle() - 170_f64.to_radians())
    };
    let heading = heading.unwrap();
    let errors: Vec<f64> = heading.iter().map(off_rad).collect();
    assert_eq!(errors.len(), 4000);
    let ratio = deviation(&errors) / 0.3_f64.to_radians();
    assert!((0.95..1.05).contains(&ratio), "{ratio}");
    assert!(heading.iter().all(|it| it.1[0].abs() <= PI));

    assert_eq!(simulated("scans = 2").1, [const { None }; 4]);
}

#[test]
fn each_error_of_a_gyro_is_as_large_as_its_figure() {
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
            let mut rng = Stream::GYRO_ERRORS.generator(seed);
            let mut measure = figures.measure(&mut rng, |_| motion);
            let mut rate = || measure(&mut rng, [0.0; 2], false).unwrap()[2];
            (0..6000).map(|_| rate() - 0.2).sum::<f64>() / RATE_HZ
        };
        let ratio = deviation(&(0..400).map(error_rad).collect::<Vec<_>>()) / expected_rad;
        assert!((0.88..1.12).contains(&ratio), "{name}: {ratio}");
    }
}

#[test]
fn the_numbers_of_each_log_are_those_of_the_samples_which_more_scans_extend() {
    const SETTINGS: &str = "gyro = {profile = 'asm330lhh', faults = true}\n\
        wheels = {rate_hz = 50.0, faults = true}\ngnss = {rate_hz = 5.0, faults = true}\n\
        heading.rate_hz = 10.0";
    let records = |scans: usize| simulated(&format!("scans = {scans}\n{SETTINGS}")).1;
    for ((kind, few), more) in KINDS.iter().zip(records(20)).zip(records(30)) {
        let few = few.unwrap();
        let text = kind.csv(&few);
        let rows: Vec<&str> = text.lines().skip(1).collect();
        assert_eq!(rows.len(), few.len());
        for (row, (stamp_ns, values)) in rows.iter().zip(&few) {
            let (stamp, fields) = row.split_once(',').unwrap();
            assert_eq!(stamp.parse(), Ok(*stamp_ns));
            for (field, column) in fields.split(',').zip(kind.columns) {
                assert_eq!(field.parse(), Ok(values[*column]));
            }
        }
        assert!(kind.csv(&more.unwrap()).starts_with(&text), "{}", kind.file);
    }
    // Each value is in the column that the first row names: the altitude of a fix is in none.
    let record = (7, [1.0, 2.0, 3.0, 4.0, 5.0, 6.0]);
    let row = |kind: Kind| kind.csv(&[record]).lines().nth(1).unwrap().to_owned();
    assert_eq!(KINDS.map(row), ["7,1,2,3,4,5,6", "7,1", "7,1,2,4", "7,1"]);
}

#[test]
fn with_faults_hosts_stall_wheels_slip_receivers_are_in_holes_and_samples_are_lost() {
    let simulated = |faults: bool| {
        let (simulator, records) = simulated(&format!(
            "scans = 400\ngyro = {{profile = 'exact', delay_s = 1.5, faults = {faults}}}\n\
            wheels = {{rate_hz = 50.0, delay_s = -0.5, faults = {faults}}}\n\
            gnss = {{rate_hz = 25.0, faults = {faults}}}\nheading.rate_hz = 25.0"
        ));
        let start_ns = simulator.span().0;
        let since = |(stamp_ns, values)| ((stamp_ns - start_ns) as f64 * 1e-9, values);
        records.map(|it| it.unwrap().into_iter().map(since).collect::<Vec<_>>())
    };
    let (good, faulty) = (simulated(false), simulated(true));
    for (samples, [rate_hz, middle_s]) in
        good.iter()
            .zip([[100.0, 1.505], [50.0, -0.49], [25.0, 0.0]])
    {
        assert_eq!(samples.len(), (100.0 * rate_hz) as usize);
        for (index, (time_s, _)) in samples.iter().enumerate() {
            let delay_s = time_s - index as f64 / rate_hz;
            assert!((delay_s - middle_s).abs() < 1e-6, "{delay_s}");
        }
    }
    // A fiftieth of the samples is lost; of 100 s, the holes take 37.5 s in the mean.
    let counts = faulty.each_ref().map(Vec::len);
    assert!((9_720..9_880).contains(&counts[0]), "{counts:?}");
    assert!((4_840..4_960).contains(&counts[1]), "{counts:?}");
    assert!((1_300..1_900).contains(&counts[2]), "{counts:?}");
    // 50 stalls of 6 samples, which are no more at the times of their measurement.
    let is_on_time = |time_s: f64| {
        let periods = (time_s - 1.505) * RATE_HZ;
        (periods - periods.round()).abs() < 1e-4
    };
    let stalled = faulty[0].iter().filter(|it| !is_on_time(it.0)).count();
    assert!((250..400).contains(&stalled), "{stalled}");
    assert!(faulty[0].is_sorted_by(|a, b| a.0 < b.0));
    // The samples of a stall come at the end of the stall, all at once.
    let pauses_s = faulty[0].windows(3).filter_map(|it| {
        let [pause_s, next_s] = [it[1].0 - it[0].0, it[2].0 - it[1].0];
        (next_s < 2e-4 && pause_s > 2e-4).then_some(pause_s)
    });
    let pauses_s: Vec<f64> = pauses_s.collect();
    assert!(pauses_s.len() >= 45 && pauses_s.iter().all(|it| *it > 0.05));
    // An eighth of 5000 samples.
    let slips = faulty[1].iter().filter(|(time_s, values)| {
        let mut rolls = good[1].iter().filter(|it| (it.0 - time_s).abs() < 1e-6);
        rolls.any(|(_, rolls)| values[0] > 1.2 * rolls[0])
    });
    let slips = slips.count();
    assert!((550..=700).contains(&slips), "{slips}");
}
