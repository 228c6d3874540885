use std::{collections::BTreeSet, f64::consts::TAU};

use gyre_geometry::{
    Twist,
    scan::{OwnedScan, SweepGeometry},
};

use super::*;

const AZIMUTHS: usize = 400;
const BINS: usize = 576;
const BIN_M: f32 = 0.175;
const TURN_S: f64 = 0.25;

/// Points in the world: x, y, m.
fn world(seed: u64) -> Vec<[f64; 2]> {
    // Evenly and irregularly spread over the square, by a sequence of low discrepancy.
    let at = |i: u64, step: f64| 220.0 * ((1 + seed * 431 + i) as f64 * step).fract() - 110.0;
    (0..400)
        .map(|i| [at(i, 0.754_877_666), at(i, 0.569_840_291)])
        .collect()
}

/// The scan of a turn from `start_s` on, measured while moving.
fn scan(world: &[[f64; 2]], twist: &Twist, start_s: f64) -> OwnedScan {
    let time_s = |azimuth: f64| start_s + TURN_S * azimuth / AZIMUTHS as f64;
    let mut scan = OwnedScan::of(SweepGeometry {
        azimuths: AZIMUTHS,
        bins: BINS,
        stride: BINS,
        range_resolution_m: BIN_M,
        stamp_ns: (time_s(200.0) * 1e9) as i64,
        ..SweepGeometry::default()
    });
    for azimuth in 0..AZIMUTHS {
        scan.stamp_ns[azimuth] = (time_s(azimuth as f64) * 1e9) as i64;
        scan.azimuth_rad[azimuth] = (azimuth as f64 / AZIMUTHS as f64 * TAU) as f32;
        scan.flags[azimuth] = flag::MEASURED | flag::ASSUMED;
        let sensor = twist.pose_at(time_s(azimuth as f64)).inverse();
        for [x, y] in world {
            let seen = sensor * nalgebra::Point2::new(*x, *y);
            let off = (-seen.y).atan2(seen.x) / TAU * AZIMUTHS as f64 - azimuth as f64;
            let off = (off + 200.0).rem_euclid(400.0) - 200.0;
            let bin = (seen.coords.norm() / f64::from(BIN_M)) as usize;
            // A beam of 1.8 degrees.
            let power = 200.0 * (-0.7 * off * off).exp();
            for bin in bin.saturating_sub(3)..(bin + 4).min(BINS) {
                let power_at = &mut scan.bytes[azimuth * BINS + bin];
                *power_at = power_at.saturating_add(power as u8);
            }
        }
    }
    scan
}

/// Loses azimuths as the host does: the rows behind move up, and the last rows keep the scan
/// before. Returns the rows before which they were lost.
fn lose(scan: &mut OwnedScan, before: &OwnedScan, azimuths: &[usize]) -> Vec<u16> {
    let kept = (0..AZIMUTHS).filter(|azimuth| !azimuths.contains(azimuth));
    let mut bytes: Vec<u8> = kept
        .flat_map(|azimuth| scan.bytes[azimuth * BINS..][..BINS].to_vec())
        .collect();
    bytes.extend_from_slice(&before.bytes[bytes.len()..]);
    scan.bytes = bytes;
    scan.flags[AZIMUTHS - azimuths.len()..].fill(flag::STALE | flag::ASSUMED);
    (0..)
        .zip(azimuths)
        .map(|(i, azimuth)| *azimuth as u16 - i)
        .collect()
}

/// Places that are all known.
fn certain(rows: &[u16]) -> LostAzimuths {
    LostAzimuths::between(rows.iter().map(|row| [*row; 2]))
}

#[test]
fn lost_azimuths_are_found_where_they_were_lost() {
    let mut distances = Vec::new();
    for case in 0..40_u64 {
        let share = |step: f64| ((case + 1) as f64 * step).fract();
        let twist = Twist::from([30.0 * share(0.618) - 5.0, 0.1, 0.8 * share(0.755) - 0.4]);
        let world = world(case);
        // In the scan before some were lost too, at places that are known by now.
        let mut before = scan(&world, &twist, 0.0);
        let whole = before.clone();
        let known = certain(&lose(&mut before, &whole, &[120, 300]));
        let mut now = scan(&world, &twist, TURN_S);
        // One that is lost at the seam looks like a turn of the whole scan by its width.
        let at = |i: u64| 15 + (share(0.57) * 370.0 + i as f64 * 229.0) as usize % 370;
        let azimuths: BTreeSet<usize> = (0..=case % 5).map(at).collect();
        let lost = lose(&mut now, &before, &Vec::from_iter(azimuths));
        let mut finder = LostAzimuthFinder::default();
        finder.set_previous(&before.view(), &known);
        let found = finder.find(&now.view(), Some(twist));
        assert_eq!(found.count(), lost.len());
        let middles = found
            .gaps()
            .iter()
            .map(|[first, last, _]| (first + last) / 2);
        distances.extend(middles.zip(&lost).map(|(a, b)| a.abs_diff(*b)));
    }
    let near = distances.iter().filter(|distance| **distance <= 4).count();
    assert!(near * 100 >= distances.len() * 95, "{distances:?}");
}

#[test]
fn bursts_are_found_wherever_they_are_and_counted_where_they_are_not() {
    let [twist, predicted] = [0.1, 0.14].map(|yaw_rate| Twist::from([8.0, 0.1, yaw_rate]));
    let before = scan(&world(3), &twist, 0.0);
    let whole = scan(&world(3), &twist, TURN_S);
    // The first azimuth of each burst and their number.
    let bursts: [&[[usize; 2]]; 9] = [
        &[[0, 9]],
        &[[0, 40]],
        &[[120, 9]],
        &[[250, 40]],
        &[[391, 9]],
        &[[360, 40]],
        &[[0, 12], [290, 9]],
        &[[40, 20], [180, 11], [370, 30]],
        &[[0, MAX_LOST + 1]],
    ];
    for bursts in bursts {
        let lost = Vec::from_iter(bursts.iter().flat_map(|[at, count]| *at..at + count));
        let mut now = whole.clone();
        lose(&mut now, &before, &lost);
        let mut finder = LostAzimuthFinder::default();
        finder.set_previous(&before.view(), &LostAzimuths::default());
        let unknown = finder.clone().find(&now.view(), None);
        assert_eq!([unknown.count(), unknown.unplaced()], [lost.len(); 2]);
        // The rows behind are turned by all of them or by none: evenly distributed.
        let sigma_steps = unknown.variance_of_mean_rad2(AZIMUTHS).sqrt() / TAU as f32 * 400.0;
        let share = sigma_steps / lost.len() as f32;
        assert!((share - 12.0_f32.sqrt().recip()).abs() < 0.01, "{share}");
        let found = finder.find(&now.view(), Some(predicted));
        if lost.len() > MAX_LOST {
            assert_eq!(found, unknown);
            continue;
        }
        assert_eq!((found.gaps().len(), found.unplaced()), (bursts.len(), 0));
        let mut earlier = 0;
        for ([first, last, count], burst) in found.gaps().iter().zip(bursts) {
            let azimuth = usize::from((first + last) / 2) + earlier;
            let is_found = azimuth.abs_diff(burst[0]) <= 1 && usize::from(*count) == burst[1];
            assert!(is_found, "{bursts:?}: {found:?}");
            earlier += burst[1];
        }
    }
}

#[test]
fn rows_are_placed_at_the_azimuths_where_they_were_measured() {
    let (world, twist) = (world(1), Twist::default());
    let before = scan(&world, &twist, 0.0);
    let whole = scan(&world, &twist, TURN_S);
    let mut now = whole.clone();
    let lost = certain(&lose(&mut now, &before, &[0, 7, 8, 399]));
    assert_eq!(
        lost.gaps(),
        [[0, 0, 1], [6, 6, 1], [6, 6, 1], [396, 396, 1]]
    );
    let (view, mut rows) = (now.view(), PlacedRows::default());
    let placed = rows.place(&view, &lost);
    assert_eq!(placed.geometry.azimuths, 396);
    placed.check().unwrap();
    placed.check_times().unwrap();
    let kept = (0..AZIMUTHS).filter(|azimuth| ![0, 7, 8, 399].contains(azimuth));
    for (row, azimuth) in kept.enumerate() {
        assert_eq!(placed.row(row), whole.view().row(azimuth));
        assert_eq!(placed.azimuth_rad[row], whole.azimuth_rad[azimuth]);
        assert_eq!(placed.stamp_ns[row], whole.stamp_ns[azimuth]);
    }
}

#[test]
fn angles_that_wrap_around_anywhere_are_placed_in_their_order() {
    let (world, twist) = (world(1), Twist::default());
    let before = scan(&world, &twist, 0.0);
    let mut now = scan(&world, &twist, TURN_S);
    lose(&mut now, &before, &[2, 390]);
    for turned_rad in [-0.001, 0.001, 3.0] {
        for (azimuth, angle) in now.azimuth_rad.iter_mut().enumerate() {
            let straight = (azimuth as f64 / AZIMUTHS as f64 * TAU) as f32;
            *angle = (straight + turned_rad).rem_euclid(TAU as f32);
        }
        let (view, mut rows) = (now.view(), PlacedRows::default());
        let lost = LostAzimuths::between([[0, 3], [380, 398]]);
        let placed = rows.place(&view, &lost);
        let steps = placed.azimuth_rad.windows(2).map(|two| {
            let step_rad = (two[1] - two[0]).rem_euclid(TAU as f32);
            step_rad / TAU as f32 * AZIMUTHS as f32
        });
        for (row, step) in steps.enumerate() {
            assert!((0.99..1.51).contains(&step), "{turned_rad} {row}: {step}");
        }
    }
}

#[test]
fn scans_of_any_shape_and_offset_are_looked_at() {
    let (world, twist) = (world(1), Twist::default());
    let before = scan(&world, &twist, 0.0);
    for (azimuths, bins, offset_m) in [(400, 576, -200.0), (400, 3, 0.0), (20, 40, 0.0)] {
        let mut finder = LostAzimuthFinder::default();
        for start_s in [0.0, TURN_S] {
            let mut now = scan(&world, &twist, start_s);
            lose(&mut now, &before, &[50, 51]);
            now.flags[azimuths - 2..].fill(flag::STALE | flag::ASSUMED);
            (now.geometry.azimuths, now.geometry.bins) = (azimuths, bins);
            now.geometry.range_offset_m = offset_m;
            let found = finder.find(&now.view(), Some(twist));
            assert_eq!(
                found.gaps(),
                [[0, azimuths as u16 - 2, 1]; 2],
                "{bins} bins"
            );
        }
    }
}

#[test]
fn without_a_scan_before_they_may_be_anywhere_and_measured_azimuths_are_never_moved() {
    let (world, twist) = (world(2), Twist::default());
    let before = scan(&world, &twist, 0.0);
    let mut now = scan(&world, &twist, TURN_S);
    lose(&mut now, &before, &[50, 51]);
    let mut finder = LostAzimuthFinder::default();
    assert_eq!(finder.find(&now.view(), None).gaps(), [[0, 398, 1]; 2]);
    for flags in &mut now.flags {
        *flags = flag::MEASURED;
    }
    assert_eq!(finder.find(&now.view(), None), LostAzimuths::default());
}

#[test]
fn the_variance_of_the_mean_azimuth_is_that_over_all_places() {
    for rows in [[7_u16, 7], [120, 150], [0, 398]] {
        let lost = LostAzimuths::between([rows]);
        let measured = AZIMUTHS - 1;
        // Behind the place the rows lie one step further on.
        let means: Vec<f64> = (rows[0]..=rows[1])
            .map(|place| (measured - usize::from(place)) as f64 / measured as f64)
            .map(|steps| steps * TAU / AZIMUTHS as f64)
            .collect();
        let mean = means.iter().sum::<f64>() / means.len() as f64;
        let variance = means.iter().map(|it| (it - mean).powi(2)).sum::<f64>() / means.len() as f64;
        let stated = f64::from(lost.variance_of_mean_rad2(AZIMUTHS));
        assert!((stated - variance).abs() <= 1e-5 * variance, "{rows:?}");
        let twice = LostAzimuths::between([rows, rows]);
        // Two places vary independently.
        let both = f64::from(twice.variance_of_mean_rad2(AZIMUTHS));
        assert!((both - 2.0 * variance).abs() <= 0.02 * variance, "{rows:?}");
    }
}
