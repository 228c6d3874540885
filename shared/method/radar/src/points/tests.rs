use gyre_geometry::{
    SparsePoint,
    scan::{OwnedScan, Sense, flag},
};
use proptest::prelude::*;

use super::{PointExtractor, PointsConfig, WEIGHT_CAP};
use crate::raster::tests::scene::Sensor;

const UNSET: SparsePoint = SparsePoint {
    x_m: f32::NAN,
    y_m: f32::NAN,
    time_s: f32::NAN,
    weight: f32::NAN,
    doppler_s: f32::NAN,
};

fn extract(config: &PointsConfig, scan: &OwnedScan, floor: u8) -> Vec<SparsePoint> {
    let mut out = vec![UNSET; config.capacity];
    let count = PointExtractor::new(config)
        .unwrap()
        .extract(&scan.view(), floor, &mut out)
        .unwrap();
    assert!(
        out[count..].iter().all(|point| point.x_m.is_nan()),
        "only points are written"
    );
    out.truncate(count);
    out
}

/// The points by their definition: compares every cell of every azimuth with all azimuths.
fn direct(config: &PointsConfig, scan: &OwnedScan, floor: u8) -> Vec<SparsePoint> {
    let view = scan.view();
    let geometry = &view.geometry;
    let depth = (config.range_cell_m / geometry.range_resolution_m)
        .round()
        .max(1.0) as usize;
    let measured = |azimuth: usize| view.flags[azimuth] & flag::MEASURED != 0;
    let power = |azimuth: usize, cell: usize| {
        let sum: i32 = view.row(azimuth)[cell * depth..][..depth]
            .iter()
            .map(|&bin| i32::from(bin))
            .sum();
        (sum - i32::from(floor) * depth as i32).max(0)
    };
    let within_beam = |a: usize, b: usize| {
        let turn = (view.azimuth_rad[a] - view.azimuth_rad[b])
            .to_degrees()
            .rem_euclid(360.0);
        turn.min(360.0 - turn) <= config.beam_deg + 180.0 / geometry.azimuths as f32
    };
    let mut points = Vec::new();
    for azimuth in (0..geometry.azimuths).filter(|&azimuth| measured(azimuth)) {
        for cell in 0..geometry.bins / depth {
            let range_m = view.range_m((cell * depth) as f32 + 0.5 * (depth as f32 - 1.0));
            let here = power(azimuth, cell);
            let rivals = (0..geometry.azimuths)
                .filter(|&other| measured(other) && within_beam(azimuth, other));
            let mut rivals = rivals.map(|other| power(other, cell));
            let suppressed = rivals.any(|there| there > here);
            let is_within = (config.min_range_m..=config.max_range_m).contains(&range_m);
            if here == 0 || suppressed || !is_within {
                continue;
            }
            let (sin, cos) = view.azimuth_rad[azimuth].sin_cos();
            let is_clockwise = geometry.sense == Sense::Clockwise;
            let left = if is_clockwise { -sin } else { sin };
            let weight = (here as f32 / depth as f32 / WEIGHT_CAP).min(1.0);
            let time_s = (view.stamp_ns[azimuth] - geometry.stamp_ns) as f32 * 1e-9;
            points.push(SparsePoint {
                x_m: range_m * cos,
                y_m: range_m * left,
                time_s,
                weight,
                doppler_s: view.doppler_s(azimuth),
            });
        }
    }
    points
}

/// Noise at irregular azimuths, one in ten of them not measured.
fn noise(azimuths: usize, bins: usize, range_resolution_m: f32, seed: u32) -> OwnedScan {
    let mut state = seed;
    let mut random = move || {
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        state >> 24
    };
    let turn = std::f32::consts::TAU / azimuths as f32;
    let mut scan = Sensor {
        azimuth_rad: (0..azimuths)
            .map(|i| (i as f32 + random() as f32 / 1024.0) * turn)
            .collect(),
        time_s: (0..azimuths).map(|i| 1e-3 * (i as f64 - 10.0)).collect(),
        bins,
        range_resolution_m,
        range_offset_m: -0.31,
        doppler_s: 0.049,
        chirps_alternate: seed.is_multiple_of(2),
        sense: if seed.is_multiple_of(3) {
            Sense::Clockwise
        } else {
            Sense::CounterClockwise
        },
        ..Sensor::navtech()
    }
    .scan();
    scan.bytes.fill_with(|| random() as u8);
    for flags in scan.flags.iter_mut().filter(|_| random() < 26) {
        *flags &= !flag::MEASURED;
    }
    scan
}

fn assert_alike(got: &[SparsePoint], expected: &[SparsePoint]) {
    assert_eq!(got.len(), expected.len());
    for (got, expected) in got.iter().zip(expected) {
        let [got_fields, expected_fields] = [got, expected].map(|&point| <[f32; 5]>::from(point));
        let near = got_fields
            .iter()
            .zip(expected_fields)
            .all(|(got, expected)| (got - expected).abs() < 1e-4);
        assert!(near, "{got:?} for {expected:?}");
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]
    #[test]
    fn points_are_those_of_the_definition(
        azimuths in 1usize..90, bins in 1usize..300, resolution_m in 0.03..0.4f32, seed: u32, floor in 40u8..255,
        beam_deg in 0.0..20.0f32, (min_range_m, depth_m) in (0.0..20.0f32, 1.0..40.0f32),
    ) {
        let scan = noise(azimuths, bins, resolution_m, seed);
        let max_range_m = min_range_m + depth_m;
        let config = PointsConfig { beam_deg, min_range_m, max_range_m, capacity: 60_000, ..PointsConfig::default() };
        assert_alike(&extract(&config, &scan, floor), &direct(&config, &scan, floor));
    }

    #[test]
    fn the_strongest_points_are_kept(seed: u32, capacity in 0usize..400) {
        let scan = noise(40, 200, 0.17, seed);
        // No weight above this floor reaches 1.
        const FLOOR: u8 = 195;
        let all = PointsConfig::default();
        let config = PointsConfig { capacity, ..all.clone() };
        let (all, few) = (extract(&all, &scan, FLOOR), extract(&config, &scan, FLOOR));
        prop_assert!(few.len() <= capacity);
        let weakest = few.iter().map(|point| point.weight).fold(1.0, f32::min);
        let is_kept = |point: &&SparsePoint| !few.is_empty() && point.weight >= weakest;
        prop_assert_eq!(&all.iter().filter(is_kept).copied().collect::<Vec<_>>(), &few);
        // With a threshold one step lower there are too many.
        let next = all.iter().map(|point| point.weight).filter(|&weight| few.is_empty() || weight < weakest).fold(0.0, f32::max);
        prop_assert!(all.len() <= capacity || all.iter().filter(|point| point.weight >= next).count() > capacity);
    }
}

#[test]
fn the_previous_scan_leaves_no_trace() {
    let scans = [
        noise(90, 300, 0.05, 1),
        noise(40, 200, 0.3, 2),
        noise(90, 300, 0.05, 3),
    ];
    let config = PointsConfig {
        capacity: 200,
        ..PointsConfig::default()
    };
    let mut extractor = PointExtractor::new(&config).unwrap();
    let mut out = vec![UNSET; 200];
    for scan in scans.iter().chain(&scans) {
        let count = extractor.extract(&scan.view(), 120, &mut out).unwrap();
        assert_eq!(out[..count], extract(&config, scan, 120));
    }
}

#[test]
fn tiny_scans_have_no_points_and_inconsistent_ones_are_rejected() {
    for (azimuths, bins) in [(1, 0), (1, 1), (1, 500), (2, 2)] {
        let mut scan = noise(azimuths, bins, 0.0438, 4);
        assert!(extract(&PointsConfig::default(), &scan, 255).is_empty());
        scan.bytes.fill(255);
        extract(&PointsConfig::default(), &scan, 0);
    }
    let mut scan = noise(4, 10, 0.1, 5);
    scan.geometry.bins = 11;
    let rejected = PointExtractor::new(&PointsConfig::default())
        .unwrap()
        .extract(&scan.view(), 0, &mut [UNSET]);
    assert!(rejected.unwrap_err().to_string().contains("image has"));
}

#[test]
fn settings_out_of_bounds_are_rejected_by_name() {
    let many = PointsConfig {
        capacity: 100_000,
        ..PointsConfig::default()
    };
    let rejected = PointExtractor::new(&many).unwrap_err().to_string();
    assert!(rejected.starts_with("points.capacity is "));
}
