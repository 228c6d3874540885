use std::f64::consts::TAU;

use nalgebra::Vector2;
use proptest::prelude::*;

use super::{DopplerEstimator, NoDoppler, check_chirps};
use crate::raster::tests::scene::Sensor;
use gyre_geometry::scan::{OwnedScan, Sense, flag};

const MIN_RANGE_M: f32 = 5.0;
/// Width of the beam, standard deviation, and of an echo along the range, m.
const BEAM_RAD: f64 = 0.009;
const ECHO_M: f64 = 0.12;

/// A scatterer at a bearing (clockwise or not, as the sensor turns), with its own velocity.
#[derive(Clone, Copy, Debug)]
struct Scatterer {
    bearing_rad: f64,
    range_m: f64,
    power: f64,
    velocity: Vector2<f64>,
}

fn random(seed: u64) -> impl FnMut() -> f64 {
    let mut state = seed.wrapping_mul(2_862_933_555_777_941_757).wrapping_add(1);
    move || {
        state = state
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        (state >> 11) as f64 / (1_u64 << 53) as f64
    }
}

/// Scatterers at random bearings, with a velocity for all in one sector.
fn scene(count: usize, seed: u64, moving: (f64, Vector2<f64>)) -> Vec<Scatterer> {
    let mut next = random(seed);
    let scatterer = |_| {
        let share = next();
        Scatterer {
            bearing_rad: share * TAU,
            range_m: 8.0 + 80.0 * next(),
            power: 60.0 + 120.0 * next(),
            velocity: if share < moving.0 {
                moving.1
            } else {
                Vector2::zeros()
            },
        }
    };
    (0..count).map(scatterer).collect()
}

/// Navtech's RAS6, in part.
fn ras6(sense: Sense) -> Sensor {
    Sensor {
        bins: 2400,
        range_resolution_m: 0.0438,
        range_offset_m: -0.31,
        doppler_s: 0.0505,
        chirps_alternate: true,
        sense,
        ..Sensor::navtech()
    }
}

fn measured(sensor: &Sensor, scatterers: &[Scatterer], velocity: Vector2<f64>) -> OwnedScan {
    let mut scan = sensor.scan();
    let geometry = scan.geometry;
    let resolution_m = f64::from(geometry.range_resolution_m);
    let shifts: Vec<f64> = (0..geometry.azimuths)
        .map(|azimuth| f64::from(scan.view().doppler_s(azimuth)))
        .collect();
    for scatterer in scatterers {
        for (azimuth, shift_s) in shifts.iter().enumerate() {
            let bearing_rad = f64::from(scan.azimuth_rad[azimuth]);
            let off_rad = (scatterer.bearing_rad - bearing_rad + 0.5 * TAU).rem_euclid(TAU);
            let off_beam = (off_rad - 0.5 * TAU) / BEAM_RAD;
            if off_beam.abs() > 3.0 {
                continue;
            }
            let left = match geometry.sense {
                Sense::Clockwise => -scatterer.bearing_rad.sin(),
                Sense::CounterClockwise => scatterer.bearing_rad.sin(),
            };
            let direction = Vector2::new(scatterer.bearing_rad.cos(), left);
            let approach_mps = direction.dot(&(velocity - scatterer.velocity));
            let at_m = scatterer.range_m - shift_s * approach_mps;
            let at_bin = (at_m - f64::from(geometry.range_offset_m)) / resolution_m - 0.5;
            let power = scatterer.power * (-0.5 * off_beam * off_beam).exp();
            let row = &mut scan.bytes[geometry.first_byte + azimuth * geometry.stride..];
            let first = (at_bin - 12.0).max(0.0) as usize;
            for (bin, cell) in row.iter_mut().enumerate().skip(first).take(25) {
                let off = (bin as f64 - at_bin) * resolution_m / ECHO_M;
                let here = (power * (-0.5 * off * off).exp()).round() as u8;
                *cell = cell.saturating_add(here);
            }
        }
    }
    scan
}

fn estimate(scan: &OwnedScan) -> Result<gyre_geometry::samples::Evidence, NoDoppler> {
    DopplerEstimator::default().estimate(&scan.view(), MIN_RANGE_M)
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(32))]
    /// With a quarter of all bearings on something that moves, as beside a bus. What moves slower
    /// than 5 m/s shifts echoes by less than they are wide, and draws the velocity by up to 0.4
    /// m/s.
    #[test]
    fn shifted_rows_say_the_velocity_whatever_moves_in_a_quarter_of_them(
        ahead in -35.0..35.0f64, left in -3.0..3.0f64, clockwise: bool, moving_share in 0.0..0.25f64,
        (moving_mps, forwards, moving_left) in (5.0..20.0f64, any::<bool>(), -5.0..5.0f64), seed: u64,
    ) {
        let sense = if clockwise { Sense::Clockwise } else { Sense::CounterClockwise };
        let moving_ahead = if forwards { moving_mps } else { -moving_mps };
        let moving = (moving_share, Vector2::new(moving_ahead, moving_left));
        let velocity = Vector2::new(ahead, left);
        let scan = measured(&ras6(sense), &scene(250, seed, moving), velocity);
        let found = estimate(&scan).unwrap();
        let off = Vector2::from(found.value) - velocity;
        prop_assert!(off.norm() < 0.25, "off by {off}");
        let [xx, xy, yy] = found.covariance;
        prop_assert!(xx > 0.0 && yy > 0.0 && xy * xy < xx * yy);
        prop_assert!(xx.max(yy) < 0.04, "{xx}, {yy}");
        let expected = 5.0 * xx.max(yy).sqrt() + 0.1;
        prop_assert!(off.norm() < expected, "off by {off} with {expected}");
    }

    /// A coefficient with the other sign gives the same result, because the chirps determine the
    /// direction of each shift.
    #[test]
    fn the_sign_is_that_of_the_chirps(ahead in 3.0..30.0f64, seed: u64) {
        let mut scan = measured(&ras6(Sense::Clockwise), &scene(200, seed, (0.0, Vector2::zeros())), Vector2::new(ahead, 0.0));
        let before = estimate(&scan).unwrap();
        scan.geometry.doppler_s = -scan.geometry.doppler_s;
        prop_assert_eq!(estimate(&scan).unwrap(), before);
        // With chirps that are taken for the others the vehicle drives backwards.
        scan.flags.iter_mut().for_each(|flags| *flags ^= flag::CHIRP_UP);
        let backwards = estimate(&scan).unwrap().value[0];
        prop_assert!((backwards + before.value[0]).abs() < 1e-6);
    }
}

#[test]
fn the_scan_before_leaves_no_trace() {
    let scans = [12.0, -5.0, 20.0].map(|ahead| {
        let sensor = ras6(Sense::Clockwise);
        measured(
            &sensor,
            &scene(200, ahead as u64, (0.0, Vector2::zeros())),
            Vector2::new(ahead, 0.5),
        )
    });
    let mut estimator = DopplerEstimator::default();
    for scan in scans.iter().chain(&scans) {
        let found = estimator.estimate(&scan.view(), MIN_RANGE_M).unwrap();
        assert_eq!(found, estimate(scan).unwrap());
    }
}

#[test]
fn what_a_scan_lacks_is_named() {
    let velocity = Vector2::new(10.0, 0.0);
    let scatterers = scene(200, 5, (0.0, Vector2::zeros()));
    let good = measured(&ras6(Sense::Clockwise), &scatterers, velocity);
    assert!(check_chirps(&good.view()).is_ok());
    let with = |edit: fn(&mut OwnedScan)| {
        let mut scan = good.clone();
        edit(&mut scan);
        estimate(&scan).unwrap_err()
    };
    let unknown = with(|scan| scan.flags.fill(flag::MEASURED));
    assert_eq!(unknown, NoDoppler::UnknownChirps);
    let all_rise = flag::MEASURED | flag::CHIRP_KNOWN | flag::CHIRP_UP;
    assert_eq!(all_rise, 7);
    let alike = with(|scan| scan.flags.fill(7));
    assert!(matches!(
        alike,
        NoDoppler::NotAlternating { alternating: 0, .. }
    ));
    let coefficient = with(|scan| scan.geometry.doppler_s = 0.0);
    assert_eq!(coefficient, NoDoppler::NoCoefficient);
    let empty = with(|scan| scan.bytes.fill(0));
    assert!(matches!(
        empty,
        NoDoppler::TooFewBearings { bearings: 0, .. }
    ));
    let noise = with(|scan| {
        let mut next = random(1);
        scan.bytes.fill_with(|| (255.0 * next()) as u8);
    });
    assert!(
        matches!(
            noise,
            NoDoppler::NoAgreement { .. } | NoDoppler::TooFewBearings { .. }
        ),
        "{noise}"
    );
    let inconsistent = with(|scan| scan.geometry.bins = usize::MAX / 2);
    assert!(matches!(inconsistent, NoDoppler::Scan(_)));
}

#[test]
fn scans_of_any_shape_are_looked_at() {
    for (azimuths, bins) in [(0, 0), (2, 5), (3, 4000), (400, 1), (40, 130)] {
        let sensor = Sensor {
            azimuth_rad: (0..azimuths)
                .map(|k| (k as f64 / azimuths as f64 * TAU) as f32)
                .collect(),
            time_s: (0..azimuths).map(|k| 6e-4 * f64::from(k)).collect(),
            bins,
            ..ras6(Sense::Clockwise)
        };
        let mut scan = sensor.scan();
        for power in [0, 255] {
            scan.bytes.fill(power);
            assert!(estimate(&scan).is_err(), "{azimuths} x {bins}");
        }
    }
}
