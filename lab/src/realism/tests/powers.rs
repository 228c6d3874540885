//! Histograms, the common grid, powers by range, saturation.

use super::*;
use proptest::prelude::*;

fn histogram(powers: &[u8]) -> Histogram {
    let mut histogram = Histogram::default();
    histogram.add(&scan(1, powers.len(), 0, |_, bin| powers[bin]).view());
    histogram
}

#[test]
fn a_histogram_knows_its_percentiles_share_above_and_highest_power() {
    let known = histogram(&[0, 0, 10, 20, 60, 61, 100, 200, 200, 255]);
    assert_eq!((known.total(), known.highest()), (10, Some(255)));
    assert_eq!(histogram(&[3, 0]).highest(), Some(3));
    assert_eq!(Histogram::default().highest(), None);
    assert_eq!(
        [0.0, 0.2, 0.21, 0.5, 0.9, 1.0].map(|share| known.percentile(share)),
        [0, 0, 10, 60, 200, 255]
    );
    assert_eq!((known.share_above(60), known.share_above(255)), (0.5, 0.0));
}

proptest! {
    #[test]
    fn a_shifted_histogram_is_as_far_as_the_shift(powers in prop::collection::vec(0..200u8, 1..50), shift in 0..=55u8) {
        let shifted: Vec<u8> = powers.iter().map(|power| power + shift).collect();
        let distance = histogram(&powers).wasserstein(&histogram(&shifted));
        prop_assert!((distance - f64::from(shift)).abs() < 1e-9, "{distance} for {shift}");
    }

    #[test]
    fn wasserstein_is_the_mean_difference_of_sorted_powers(
        pairs in prop::collection::vec((any::<u8>(), any::<u8>()), 1..50),
    ) {
        let (mut a, mut b): (Vec<u8>, Vec<u8>) = pairs.into_iter().unzip();
        let distance = histogram(&a).wasserstein(&histogram(&b));
        a.sort_unstable();
        b.sort_unstable();
        let direct: f64 = a.iter().zip(&b).map(|(a, b)| f64::from(a.abs_diff(*b))).sum::<f64>() / a.len() as f64;
        prop_assert!((distance - direct).abs() < 1e-9);
        // As often as you like: shares count, not numbers.
        let twice = histogram(&[a.clone(), a].concat());
        prop_assert!((twice.wasserstein(&histogram(&b)) - direct).abs() < 1e-9);
    }

    #[test]
    fn a_cell_is_the_mean_over_the_range_that_it_covers(
        row in prop::collection::vec(any::<u8>(), 40), bins_a_cell in 1.0..6.0f64,
    ) {
        let scan = scan(1, row.len(), 0, |_, bin| row[bin]);
        let grid = RangeGrid { resolution_m: (bins_a_cell * f64::from(RESOLUTION_M)) as f32, cells: 6 };
        let resampled = resample(&scan.view(), grid).unwrap();
        // By small steps instead of sums.
        let bins_a_cell = f64::from(grid.resolution_m) / f64::from(RESOLUTION_M);
        for (cell, power) in resampled.view().row(0).iter().enumerate() {
            let at = |step: usize| (cell as f64 + (step as f64 + 0.5) / 10_000.0) * bins_a_cell;
            let direct = (0..10_000).map(|step| f64::from(row[at(step) as usize])).sum::<f64>() / 10_000.0;
            prop_assert!((f64::from(*power) - direct).abs() < 0.6, "cell {cell}: {power}, not {direct}");
        }
    }
}

#[test]
fn the_common_grid_is_the_coarsest_over_the_shortest_range() {
    let oxford = scan(1, 3768, 0, |_, _| 0).geometry;
    let fine = SweepGeometry {
        range_resolution_m: 0.0438,
        ..oxford
    };
    let coarse = SweepGeometry {
        range_resolution_m: 100.0 / 576.0,
        bins: 576,
        ..oxford
    };
    let grid = RangeGrid::common(&[fine, coarse]).unwrap();
    assert_eq!((grid.resolution_m, grid.cells), (100.0 / 576.0, 576));
    assert_eq!(RangeGrid::common(&[fine]).unwrap().cells, 3768);
    assert_eq!(RangeGrid::common(&[]), None);
    let none = SweepGeometry { bins: 0, ..fine };
    assert_eq!(RangeGrid::common(&[fine, none]), None);
}

#[test]
fn azimuths_and_times_survive_the_common_grid() {
    let drawn = scan(AZIMUTHS, BINS, 3, |_, bin| bin as u8);
    let grid = RangeGrid {
        resolution_m: 2.0 * RESOLUTION_M,
        cells: BINS / 2,
    };
    let resampled = resample(&drawn.view(), grid).unwrap();
    let resampled = resampled.view();
    assert!(resampled.check().is_ok());
    assert_eq!(
        (resampled.azimuth_rad, resampled.stamp_ns),
        (drawn.view().azimuth_rad, drawn.view().stamp_ns)
    );
    assert_eq!(resampled.geometry.stamp_ns, drawn.geometry.stamp_ns);
    // 0.5 and 2.5 counts: rounded away from zero.
    assert_eq!(resampled.row(7)[..2], [1, 3]);
}

#[test]
fn powers_are_known_range_by_range() {
    let one = scan(AZIMUTHS, BINS, 0, |azimuth, bin| {
        if azimuth < 40 { 100 } else { bin as u8 % 50 }
    });
    let statistics = measured([&one, &one]);
    assert_eq!(statistics.figure("scans"), Some(2.0));
    assert_eq!(statistics.mean_power[0], 10.0);
    assert_eq!(statistics.mean_power[149], 0.1 * 100.0 + 0.9 * 49.0);
    assert_eq!(statistics.figure("share_above"), Some(0.1));
    // 9.5 to 10.5 m are bins 47 to 52: powers 47, 48, 49, 0, 1 and 2.
    let around = statistics.figure("power_at_10_m").unwrap();
    assert!(
        (around - (10.0 + 0.9 * 147.0 / 6.0)).abs() < 1e-9,
        "{around}"
    );
}

#[test]
fn saturated_bins_are_those_that_pile_up_at_the_top() {
    let one = scan(AZIMUTHS, BINS, 0, |azimuth, bin| match (azimuth, bin) {
        (0..4, 0..25) => 160,
        (4..8, 0..25) => 157,
        (8..12, 0..25) => 156,
        _ => 20,
    });
    let share = 200.0 / (AZIMUTHS * BINS) as f64;
    assert_eq!(measured([&one]).figure("saturated_share"), Some(share));
}

#[test]
fn a_scan_that_contradicts_itself_is_refused() {
    let mut bad = scan(AZIMUTHS, BINS, 1, |_, _| 9);
    bad.geometry.stride = 10 * BINS;
    assert!(resample(&bad.view(), GRID).is_err());
}
