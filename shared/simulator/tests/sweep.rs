//! Sweeps of known scenes: places of points, occlusion, distribution of powers.

use std::f64::consts::TAU;

use gyre_geometry::{OwnedScan, ScanLimits, Twist};
use gyre_simulator::{
    Body, Path, Realism, Scene, Sensor, SensorConfig, SimulationConfig, Simulator, SweepTime,
    World,
    body::{NO_BODY, Scatterer, Wall},
    profile::{Profile, Sampling},
};
use nalgebra::Point2;

const AZIMUTHS: usize = 400;
/// Bins of the first metres; no point is placed there.
const FIRST_FREE_BIN: usize = 80;

fn sampling() -> Sampling {
    Profile::Cts350xOxford.sampling()
}

fn point(x: f64, y: f64) -> Body {
    let scatterer = Scatterer::all_round(Point2::new(x, y), 30.0, NO_BODY);
    Body {
        scatterers: vec![scatterer],
        walls: Vec::new(),
    }
}

/// A sweep that begins at time 0 of the path.
fn measured(body: Body, path: &dyn Path, sensor: &SensorConfig, realism: Realism) -> OwnedScan {
    let Sampling {
        azimuths,
        period_us,
        ..
    } = sensor.sampling();
    let time = SweepTime {
        start_us: 0,
        period_us,
        azimuths,
        epoch_us: 0,
    };
    let world = World::new(body);
    let scene = Scene {
        world: &world,
        movers: &[],
        path,
        blind: false,
    };
    let bytes = azimuths * sensor.sampling().stride();
    let mut scan = OwnedScan::with_limits(ScanLimits { bytes, azimuths });
    let mut radar = Sensor::new(sensor, realism == Realism::Exact, 7);
    scan.geometry = radar.sweep(scene, time, 0, &mut scan.slot());
    scan
}

fn sweep(body: Body, path: &dyn Path, doppler_s: f64) -> OwnedScan {
    let sensor = SensorConfig {
        doppler_s: Some(doppler_s),
        ..SensorConfig::default()
    };
    measured(body, path, &sensor, Realism::Exact)
}

/// Azimuth and bin of the maximum power, each the middle of the plateau caused by rounding.
fn brightest(scan: &OwnedScan) -> (usize, f64, u8) {
    let best = |azimuth: usize| {
        scan.view().row(azimuth)[FIRST_FREE_BIN..]
            .iter()
            .copied()
            .max()
            .unwrap_or(0)
    };
    let azimuths = 0..scan.geometry.azimuths;
    let azimuth = azimuths.max_by_key(|&azimuth| best(azimuth)).unwrap();
    let top = best(azimuth);
    let bins: Vec<usize> = (FIRST_FREE_BIN..scan.geometry.bins)
        .filter(|&bin| scan.view().row(azimuth)[bin] == top)
        .collect();
    (
        azimuth,
        bins.iter().sum::<usize>() as f64 / bins.len() as f64,
        top,
    )
}

/// The azimuth whose beam is closest to a world point when it is measured, and the range from
/// there.
fn expected(path: &dyn Path, target: Point2<f64>) -> (usize, f64) {
    let seen = |azimuth: usize| {
        let time_s = (250_000 * azimuth as i64 / AZIMUTHS as i64) as f64 * 1e-6;
        let local = path.pose(time_s).inverse_transform_point(&target);
        let off = (-local.y).atan2(local.x) - sampling().azimuth_rad(azimuth);
        (off - TAU * (off / TAU).round(), local.coords.norm())
    };
    let azimuth = (0..AZIMUTHS)
        .min_by(|&a, &b| seen(a).0.abs().total_cmp(&seen(b).0.abs()))
        .unwrap();
    (azimuth, seen(azimuth).1)
}

/// No point lies near the sweep's seam ahead: a turning vehicle sees those twice or never.
#[test]
fn point_appears_where_the_moving_sensor_passed_it() {
    for motion in [[0.0; 3], [12.0, 0.0, 0.0], [9.0, 0.5, -0.9]].map(Twist::from) {
        for (x, y) in [
            (20.0, 10.0),
            (15.0, -25.0),
            (-30.0, 4.0),
            (-12.0, -9.0),
            (60.0, -20.0),
            (3.0, 90.0),
        ] {
            let scan = sweep(point(x, y), &motion, 0.0);
            let (azimuth, bin, _) = brightest(&scan);
            let (wanted, range_m) = expected(&motion, Point2::new(x, y));
            let apart = (azimuth as i64 - wanted as i64).rem_euclid(AZIMUTHS as i64);
            assert!(
                apart <= 1 || apart == AZIMUTHS as i64 - 1,
                "({x}, {y}) {motion:?}: {azimuth} for {wanted}"
            );
            let error_m = sampling().range_m(bin) - range_m;
            assert!(
                error_m.abs() < 0.07,
                "({x}, {y}) {motion:?}: {error_m} m off {range_m} m"
            );
        }
    }
}

#[test]
fn closing_speed_shortens_the_range_ahead_and_lengthens_it_behind() {
    let motion = Twist::from([10.0, 0.0, 0.0]);
    for (x, sign) in [(30.0, -1.0), (-30.0, 1.0)] {
        let at = |shift: f64| brightest(&sweep(point(x, 6.0), &motion, shift)).1;
        let moved_m = (at(0.049) - at(0.0)) * sampling().range_resolution_m;
        assert!((moved_m - sign * 0.48).abs() < 0.06, "{x}: {moved_m} m");
    }
}

#[test]
fn wall_attenuates_what_is_behind_it_and_nothing_in_front() {
    let wall = |x: f64| Wall {
        from: Point2::new(x, -5.0),
        to: Point2::new(x, 5.0),
        transmission: 0.01,
        body: 1,
    };
    let power = |walls: Vec<Wall>| {
        let scan = sweep(
            Body {
                walls,
                ..point(30.0, 0.0)
            },
            &Twist::default(),
            0.0,
        );
        let bin = sampling().bin(30.0) as usize;
        [0, 399]
            .into_iter()
            .flat_map(|azimuth| scan.view().row(azimuth)[bin - 5..bin + 6].to_vec())
            .max()
            .unwrap()
    };
    let open = i32::from(power(vec![]));
    let hidden = open - i32::from(power(vec![wall(20.0)]));
    // 20 dB in steps of half a decibel.
    assert!((36..=44).contains(&hidden), "{hidden} counts");
    assert!((open - i32::from(power(vec![wall(40.0)]))).abs() <= 2);
}

#[test]
fn an_empty_world_gives_the_noise_of_the_receiver_and_an_exact_radar_none() {
    let mean = |noise_db: f64, realism: Realism| {
        let sensor = SensorConfig {
            noise_db,
            ..SensorConfig::default()
        };
        let scan = measured(Body::default(), &Twist::default(), &sensor, realism);
        let powers = (0..AZIMUTHS).flat_map(|azimuth| scan.view().row(azimuth)[100..].to_vec());
        powers.map(f64::from).sum::<f64>() / (AZIMUTHS * (sampling().bins - 100)) as f64
    };
    let noise = mean(0.0, Realism::Plain);
    assert!((3.0..8.0).contains(&noise), "{noise}");
    // Half a decibel is a count.
    let louder = mean(20.0, Realism::Plain) - mean(10.0, Realism::Plain);
    assert!((18.0..22.0).contains(&louder), "{louder}");
    assert_eq!(mean(0.0, Realism::Exact), 0.0);
}

#[test]
fn a_radar_of_its_own_measures_a_point_where_it_is() {
    let sensor = SensorConfig {
        bins: Some(300),
        bin_m: Some(0.5),
        azimuths: Some(720),
        period_s: Some(0.1),
        beam_deg: Some(0.5),
        range_offset_m: Some(0.0),
        ..SensorConfig::default()
    };
    let config = SimulationConfig {
        sensor: sensor.clone(),
        ..SimulationConfig::default()
    };
    config.validate().unwrap();
    let scan = measured(
        point(0.0, -60.25),
        &Twist::default(),
        &sensor,
        Realism::Exact,
    );
    let geometry = scan.geometry;
    assert_eq!((geometry.azimuths, geometry.bins), (720, 300));
    let (azimuth, bin, top) = brightest(&scan);
    assert!(azimuth.abs_diff(180) <= 1, "{azimuth}");
    assert!((bin - 120.0).abs() <= 1.0, "{bin}");
    let row = scan.view().row(azimuth).to_vec();
    let wide = row.iter().filter(|power| **power > top - 6).count();
    assert!(wide <= 3, "{wide} bins within 3 dB");
}

#[test]
fn powers_are_distributed_as_in_a_street() {
    let simulator = Simulator::new(&SimulationConfig::default()).unwrap();
    let scans = [0, 20, 40].map(|index| simulator.render_scan(index));
    let rows = scans
        .iter()
        .flat_map(|scan| (0..AZIMUTHS).flat_map(|row| scan.view().row(row)));
    let powers: Vec<f64> = rows.map(|power| f64::from(*power)).collect();
    let count = powers.len() as f64;
    let mean = powers.iter().sum::<f64>() / count;
    let bright = powers.iter().filter(|power| **power > 60.0).count() as f64 / count;
    assert!((6.0..22.0).contains(&mean), "mean {mean}");
    assert!((0.008..0.045).contains(&bright), "share above 60: {bright}");
}
