//! Sweeps of known scenes: places of points, occlusion, distribution of powers.

use std::f64::consts::TAU;

use gyre_datasets::DatasetOptions;
use gyre_geometry::{Pose, Twist, OwnedScan};
use gyre_worlds::{body::{NO_BODY, Scatterer, Wall}, profile::{Profile, Sampling}, Body, Effects, Path, SensorConfig, SimulationConfig, Simulator};
use nalgebra::Point2;

use crate::effects::scene::Setup;

/// Ringing fills the first bins; no point is placed there.
const FIRST_FREE_BIN: usize = 80;
const AZIMUTHS: usize = 400;

fn sampling() -> Sampling {
    Profile::Cts350xOxford.sampling()
}

fn point(x: f64, y: f64) -> Body {
    let scatterer = Scatterer::all_round(Point2::new(x, y), 30.0, NO_BODY);
    Body::of(vec![scatterer])
}

/// A path whose time 0 is the start of the sweep instead of its middle.
struct FromStart<'a>(&'a dyn Path);

impl Path for FromStart<'_> {
    fn pose(&self, time_s: f64) -> Pose {
        self.0.pose(time_s + 0.124_687)
    }
}

/// Measures with all effects but those that move or hide a single point.
fn sweep(body: Body, path: &dyn Path, doppler_s: f64) -> OwnedScan {
    let effects = Effects {
        encoder_wobble: false,
        dropped_azimuths: false,
        interference: false,
        ..Effects::ALL
    };
    let sensor = SensorConfig {
        doppler_s: Some(doppler_s),
        ..SensorConfig::default()
    };
    let setup = Setup {
        body,
        path: &FromStart(path),
        sensor,
        effects,
        ..Setup::default()
    };
    setup.scan()
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
    let azimuth = (0..AZIMUTHS).max_by_key(|&azimuth| best(azimuth)).unwrap();
    let top = best(azimuth);
    let bins: Vec<usize> = (FIRST_FREE_BIN..sampling().bins)
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
    let motions = [
        Twist::default(),
        Twist {
            vx_mps: 12.0,
            vy_mps: 0.0,
            yaw_rate_radps: 0.0,
        },
        Twist {
            vx_mps: 9.0,
            vy_mps: 0.5,
            yaw_rate_radps: -0.9,
        },
    ];
    for motion in motions {
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
fn point_to_the_right_lies_at_a_quarter_turn() {
    let scan = sweep(point(0.0, -20.0), &Twist::default(), 0.0);
    let (azimuth, _, _) = brightest(&scan);
    assert!(
        (99..=100).contains(&azimuth),
        "clockwise from ahead: {azimuth}"
    );
}

#[test]
fn closing_speed_shortens_the_range_ahead_and_lengthens_it_behind() {
    let motion = Twist {
        vx_mps: 10.0,
        vy_mps: 0.0,
        yaw_rate_radps: 0.0,
    };
    for (x, sign) in [(30.0, -1.0), (-30.0, 1.0)] {
        let at = |shift: f64| brightest(&sweep(point(x, 6.0), &motion, shift)).1;
        let moved_m = (at(0.049) - at(0.0)) * sampling().range_resolution_m;
        assert!((moved_m - sign * 0.48).abs() < 0.06, "{x}: {moved_m} m");
    }
}

#[test]
fn wall_attenuates_what_is_behind_it_and_nothing_in_front() {
    let wall = |x: f64| Wall::rough(Point2::new(x, -5.0), Point2::new(x, 5.0), 0.01, 1);
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
    // 20 dB in steps of half a decibel, plus noise.
    assert!((36..=44).contains(&hidden), "{hidden} counts");
    assert!((open - i32::from(power(vec![wall(40.0)]))).abs() <= 2);
}

#[test]
fn empty_world_gives_noise_and_ringing_only() {
    let scan = sweep(Body::default(), &Twist::default(), 0.0);
    let far = (0..AZIMUTHS)
        .flat_map(|azimuth| &scan.view().row(azimuth)[2800..])
        .map(|&power| f64::from(power));
    let mean = far.clone().sum::<f64>() / far.clone().count() as f64;
    assert!((3.0..8.0).contains(&mean), "mean {mean}");
    assert!(far.fold(0.0, f64::max) < 40.0);
    let ringing = scan.view().row(0)[..30]
        .iter()
        .map(|&power| f64::from(power))
        .sum::<f64>()
        / 30.0;
    assert!(ringing > 25.0, "{ringing}");
}

/// Mean power, and the share of bins above 60.
fn statistics(scans: &[OwnedScan]) -> (f64, f64) {
    let powers = || {
        scans
            .iter()
            .flat_map(|scan| (0..scan.geometry.azimuths).flat_map(|a| scan.view().row(a)))
    };
    let count = powers().count() as f64;
    let mean = powers().map(|&power| f64::from(power)).sum::<f64>() / count;
    (
        mean,
        powers().filter(|&&power| power > 60).count() as f64 / count,
    )
}

fn simulated() -> Vec<OwnedScan> {
    let simulator = Simulator::new(&SimulationConfig::default()).unwrap();
    [0, 20, 40]
        .map(|index| simulator.render_scan(index).scan)
        .to_vec()
}

#[test]
fn powers_are_distributed_as_in_a_town() {
    let (mean, bright) = statistics(&simulated());
    assert!((6.0..22.0).contains(&mean), "mean {mean}");
    assert!((0.008..0.045).contains(&bright), "share above 60: {bright}");
}

#[test]
fn powers_resemble_real_oxford_scans() {
    let Some(data) = std::env::var_os("GYRE_DATA") else {
        println!("skipped: GYRE_DATA is not set");
        return;
    };
    let folder = std::path::Path::new(&data).join("oxford-2019-01-10-14-36-48");
    let mut dataset = gyre_datasets::open(&folder, &DatasetOptions::default()).unwrap();
    let real: Vec<OwnedScan> = (0..3)
        .map(|index| {
            let mut scan = OwnedScan::with_limits(dataset.limits());
            scan.geometry = dataset.read(index, scan.slot()).unwrap();
            scan
        })
        .collect();
    let (real, ours) = (statistics(&real), statistics(&simulated()));
    println!("mean power and share above 60: real {real:?}, simulated {ours:?}");
    assert!(
        (0.5..2.0).contains(&(ours.0 / real.0)),
        "means {ours:?} and {real:?}"
    );
    assert!(
        (0.5..2.0).contains(&(ours.1 / real.1)),
        "shares above 60 {ours:?} and {real:?}"
    );
}
