//! Correlation lengths and the change from scan to scan.

use super::*;
use crate::realism::{
    change::{Change, change},
    correlation::{in_azimuth, in_range, lag_at_half, mean_power},
};
use gyre_radar::OwnedScan;
use nalgebra::{Isometry2, Point2, Vector2};
use proptest::prelude::*;

/// The autocorrelations of scans in range and in azimuth.
fn correlations(scans: &[OwnedScan]) -> [Vec<f64>; 2] {
    let samples: Vec<Sample> = scans.iter().map(|scan| sample(scan, None)).collect();
    let means = mean_power(&samples, GRID);
    [
        in_range(&samples, &means, GRID),
        in_azimuth(&samples, &means),
    ]
}

/// Noise averaged over so many azimuths and bins.
fn smoothed(seed: u64, azimuths: usize, bins: usize) -> OwnedScan {
    let noise = noise(seed, 255);
    scan(AZIMUTHS, BINS, 0, |azimuth, bin| {
        let at = |a: usize, b: usize| {
            u32::from(noise[(azimuth + a) % AZIMUTHS * BINS + (bin + b) % BINS])
        };
        let sum: u32 = (0..azimuths)
            .flat_map(|a| (0..bins).map(move |b| at(a, b)))
            .sum();
        (f64::from(sum) / (azimuths * bins) as f64).round() as u8
    })
}

#[test]
fn noise_averaged_over_a_width_is_correlated_over_half_of_it() {
    // Autocorrelation of noise through a box of m: 1 - lag / m.
    for (azimuths, bins) in [(1, 8), (6, 1), (4, 10)] {
        let one = smoothed(1, azimuths, bins);
        let statistics = measured([&one]);
        let [range, _] = correlations(&[one]);
        let expected_m = (0.5 * bins as f64).max(0.5) * f64::from(RESOLUTION_M);
        let expected_deg = (0.5 * azimuths as f64).max(0.5) * 0.9;
        let [length_m, length_deg] = ["range_correlation_m", "azimuth_correlation_deg"]
            .map(|key| statistics.figure(key).unwrap());
        assert!(
            (length_m / expected_m - 1.0).abs() < 0.05,
            "{length_m} m, not {expected_m}"
        );
        assert!(
            (length_deg / expected_deg - 1.0).abs() < 0.05,
            "{length_deg} deg, not {expected_deg}"
        );
        for (lag, value) in range.iter().enumerate() {
            let expected = (1.0 - lag as f64 / bins as f64).max(0.0);
            assert!(
                (value - expected).abs() < 0.05,
                "lag {lag}: {value}, not {expected}"
            );
        }
    }
}

#[test]
fn what_is_usual_at_a_range_correlates_nothing() {
    let noise = noise(2, 9);
    let one = scan(AZIMUTHS, BINS, 0, |azimuth, bin| {
        (240 - bin.min(200)) as u8 + noise[azimuth * BINS + bin]
    });
    let [range, azimuth] = correlations(&[one]);
    assert!(range[1].abs() < 0.02 && azimuth[1].abs() < 0.02);
    let the_same_everywhere = measured([&scan(AZIMUTHS, BINS, 0, |_, bin| bin as u8)]);
    assert_eq!(the_same_everywhere.figure("range_correlation_m"), None);
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(8))]
    #[test]
    fn the_autocorrelation_is_the_direct_sum(seed in any::<u64>(), lag in 0..20usize) {
        let scans = [smoothed(seed, 2, 3), smoothed(seed ^ 1, 3, 2)];
        let [range, azimuth] = correlations(&scans);
        let mean = |bin: usize| {
            let of = |scan: &OwnedScan| (0..AZIMUTHS).map(|a| f64::from(scan.bytes[a * BINS + bin])).sum::<f64>();
            scans.iter().map(of).sum::<f64>() / (2 * AZIMUTHS) as f64
        };
        let means: Vec<f64> = (0..BINS).map(mean).collect();
        let rest = |s: usize, a: usize, b: usize| f64::from(scans[s].bytes[a % AZIMUTHS * BINS + b]) - means[b];
        let average = |along: usize, across: usize| {
            let places = (0..2).flat_map(|s| (0..AZIMUTHS).flat_map(move |a| (0..BINS - along).map(move |b| (s, a, b))));
            let products = places.map(|(s, a, b)| rest(s, a, b) * rest(s, a + across, b + along));
            products.sum::<f64>() / (2 * AZIMUTHS * (BINS - along)) as f64
        };
        let variance = average(0, 0);
        prop_assert!((range[lag] - average(lag, 0) / variance).abs() < 1e-9);
        prop_assert!((azimuth[lag] - average(0, lag) / variance).abs() < 1e-9);
    }
}

#[test]
fn a_length_lies_between_the_lags_and_is_none_where_the_curve_stays_high() {
    assert_eq!(lag_at_half(&[1.0, 0.75, 0.25]), Some(1.5));
    assert_eq!(lag_at_half(&[1.0, 0.5]), Some(1.0));
    assert_eq!(lag_at_half(&[1.0, 0.9, 0.8]), None);
    assert_eq!(lag_at_half(&[]), None);
}

/// Posts that stand about, some 4 m apart.
fn town(seed: u64) -> Vec<Point2<f64>> {
    let random = noise(seed, 255);
    let place = |k: usize| f64::from(random[k]) / 255.0 * 60.0 - 30.0;
    (0..120)
        .map(|k| Point2::new(place(2 * k), place(2 * k + 1)))
        .filter(|p| p.coords.norm() > 4.0)
        .collect()
}

/// Returns the changes between two scans, the later one 0.25 s after the earlier.
fn between(earlier: &OwnedScan, later: &OwnedScan, motion: &Isometry2<f64>) -> Change {
    let samples = [sample(earlier, None), sample(later, Some(*motion))];
    change(&samples, GRID.range_m(), 60).unwrap().unwrap()
}

#[test]
fn the_same_scan_twice_has_not_changed() {
    let standing = |_: f64| Isometry2::identity();
    let (one, two) = (posts(&town(3), 0, standing), posts(&town(3), 1, standing));
    let change = between(&one, &two, &Isometry2::identity());
    assert!(
        change.correlation > 1.0 - 1e-9 && change.unmatched_share == 0.0 && change.pairs == 1,
        "{change:?}"
    );
}

#[test]
fn two_different_scenes_have_nothing_in_common() {
    let standing = |_: f64| Isometry2::identity();
    let (one, two) = (posts(&town(3), 0, standing), posts(&town(4), 1, standing));
    let change = between(&one, &two, &Isometry2::identity());
    assert!(
        change.correlation < 0.15 && change.unmatched_share > 0.6,
        "{change:?}"
    );
}

#[test]
fn a_drive_is_undone_by_its_motion_and_by_no_other() {
    // 12 m/s and 30 deg/s: 3 m and 7.5 degrees from scan to scan, and as much within a sweep.
    let drive = gyre_geometry::Twist {
        vx_mps: 12.0,
        vy_mps: 0.0,
        yaw_rate_radps: 0.52,
    };
    let one = posts(&town(3), 0, |t_s| drive.pose_at(t_s));
    let two = posts(&town(3), 1, |t_s| drive.pose_at(0.25 + t_s));
    let right = between(&one, &two, &drive.pose_at(0.25));
    assert!(
        right.correlation > 0.7 && right.unmatched_share < 0.05,
        "{right:?}"
    );
    let shifted = drive.pose_at(0.25) * Isometry2::new(Vector2::new(1.0, 0.0), 0.0);
    for wrong in [Isometry2::identity(), drive.pose_at(-0.25), shifted] {
        let wrong = between(&one, &two, &wrong);
        assert!(
            wrong.correlation < 0.4 && wrong.unmatched_share > 0.2,
            "{wrong:?}"
        );
    }
}

#[test]
fn a_motion_that_no_sensor_makes_is_not_compared() {
    let standing = |_: f64| Isometry2::identity();
    let samples = [
        (0, Some(0.0)),
        (1, Some(f64::NAN)),
        (2, Some(0.0)),
        (3, None),
    ];
    let samples = samples.map(|(index, x)| {
        let motion = x.map(|x| Isometry2::new(Vector2::new(x, 0.0), 0.0));
        sample(&posts(&town(3), index, standing), motion)
    });
    let change = change(&samples, GRID.range_m(), 60).unwrap().unwrap();
    assert_eq!(change.pairs, 1);
}

#[test]
fn a_post_that_is_gone_is_one_of_many_without_counterpart() {
    let standing = |_: f64| Isometry2::identity();
    // On a circle, so that all of them cover as many cells.
    let circle: Vec<Point2<f64>> = (0..20)
        .map(|k| f64::from(k) * 0.314)
        .map(|turn| Point2::new(20.0 * turn.cos(), 20.0 * turn.sin()))
        .collect();
    let (all, fewer) = (
        posts(&circle, 0, standing),
        posts(&circle[..15], 1, standing),
    );
    let change = between(&all, &fewer, &Isometry2::identity());
    assert!(
        (change.unmatched_share - 5.0 / 35.0).abs() < 0.02,
        "{change:?}"
    );
}
