//! Any input gives an error or a raster of finite powers, and the same one each time.

use gyre_geometry::{
    Twist,
    scan::{OwnedScan, Sense},
};
use nalgebra::Point2;
use ndarray::{Array2, ArrayViewMut2, s};
use proptest::prelude::*;

use super::scene::{STAMP_NS, Sensor, raster};
use crate::raster::{RasterConfig, RasterError, Rasteriser, Sampling};

fn small() -> RasterConfig {
    RasterConfig::of(33, 1.0)
}

fn sensor(azimuths: usize, bins: usize) -> Sensor {
    let turn = std::f32::consts::TAU / azimuths.max(1) as f32;
    Sensor {
        azimuth_rad: (0..azimuths).map(|i| i as f32 * turn).collect(),
        time_s: (0..azimuths).map(|i| 1e-3 * i as f64).collect(),
        bins,
        ..Sensor::navtech()
    }
}

fn try_raster(scan: &OwnedScan, twist: Option<Twist>) -> Result<Vec<f32>, RasterError> {
    let mut raster = Array2::from_elem((33, 33), f32::NAN);
    Rasteriser::new(&small())?.rasterise(&scan.view(), 10, twist, raster.view_mut())?;
    Ok(raster.into_raw_vec_and_offset().0)
}

#[test]
fn tiny_scans_give_finite_rasters() {
    for (azimuths, bins) in [
        (0, 0),
        (0, 100),
        (100, 0),
        (1, 1),
        (1, 500),
        (2, 2),
        (400, 1),
    ] {
        let mut scan = sensor(azimuths, bins).scan();
        scan.bytes.fill(255);
        let raster = try_raster(&scan, None).unwrap();
        let are_powers = raster.iter().all(|power| (0.0..=245.0).contains(power));
        assert!(are_powers, "{azimuths} x {bins}");
    }
}

#[test]
fn a_raster_of_another_shape_or_layout_is_rejected() {
    let scan = sensor(4, 10).scan();
    let mut rasteriser = Rasteriser::new(&small()).unwrap();
    let mut rejected = |raster: ArrayViewMut2<'_, f32>, actual| {
        let rejected = rasteriser.rasterise(&scan.view(), 0, None, raster);
        assert_eq!(rejected, Err(RasterError::Shape { n: 33, actual }));
    };
    rejected(Array2::zeros((33, 32)).view_mut(), [33, 32]);
    rejected(Array2::zeros((33, 33)).view_mut().reversed_axes(), [33, 33]);
    rejected(Array2::zeros((66, 33)).slice_mut(s![..;2, ..]), [33, 33]);
}

#[test]
fn power_is_a_view_of_the_rows_without_metadata() {
    let mut scan = sensor(4, 10).scan();
    let mut value = 0u8;
    scan.bytes.fill_with(|| {
        value = value.wrapping_add(7);
        value
    });
    let scan = scan.view();
    let power = scan.power();
    assert_eq!(power.dim(), (4, 10));
    for (azimuth, row) in power.rows().into_iter().enumerate() {
        assert_eq!(row.as_slice(), Some(scan.row(azimuth)));
    }
}

#[test]
fn a_scan_that_is_shorter_than_its_geometry_is_rejected() {
    let mut scan = sensor(4, 10).scan();
    scan.geometry.bins = 11;
    let rejected = try_raster(&scan, None).unwrap_err().to_string();
    let words = "image has 84 elements, but its geometry requires 85";
    assert!(rejected.contains(words), "{rejected}");
    let mut view = scan.view();
    view.stamp_ns = &[];
    let mut rasteriser = Rasteriser::new(&small()).unwrap();
    let rejected = rasteriser.rasterise(&view, 0, None, Array2::zeros((33, 33)).view_mut());
    assert!(rejected.unwrap_err().to_string().contains("stamp table"));
    scan.geometry.stride = usize::MAX;
    let rejected = try_raster(&scan, None).unwrap_err().to_string();
    assert!(rejected.contains("image has"), "{rejected}");
}

#[test]
fn numbers_out_of_bounds_are_rejected() {
    for resolution_m in [0.0, -1.0, f32::NAN, f32::INFINITY] {
        let mut scan = sensor(4, 10).scan();
        scan.geometry.range_resolution_m = resolution_m;
        let rejected = try_raster(&scan, None).unwrap_err().to_string();
        assert!(rejected.contains("range resolution"), "{rejected}");
    }
    let mut scan = sensor(4, 10).scan();
    scan.azimuth_rad[2] = f32::NAN;
    let rejected = try_raster(&scan, None).unwrap_err().to_string();
    assert!(rejected.starts_with("azimuth 2 of"), "{rejected}");
}

#[test]
fn motions_out_of_bounds_are_rejected() {
    let scan = sensor(400, 100).scan();
    let is_rejected = |scan: &OwnedScan, twist: [f64; 3]| {
        let rejected = try_raster(scan, Some(twist.into()));
        assert!(matches!(rejected, Err(RasterError::Twist { .. })));
    };
    is_rejected(&scan, [f64::NAN, 0.0, 0.0]);
    is_rejected(&scan, [0.0, f64::INFINITY, 0.0]);
    is_rejected(&scan, [0.0, 0.0, 1e3]);
    is_rejected(&scan, [1e9, 0.0, 0.0]);
    // All rows at the stamp of the scan: nothing moves, but the velocity has no number in f32.
    let mut scan = sensor(2, 100).scan();
    scan.stamp_ns.fill(scan.geometry.stamp_ns);
    is_rejected(&scan, [0.0, 0.0, -4e270]);
}

#[test]
fn settings_out_of_bounds_are_rejected_by_name() {
    let empty = RasterConfig { n: 0, ..small() };
    let rejected = Rasteriser::new(&empty).unwrap_err().to_string();
    assert!(rejected.starts_with("raster.n is "));
}

#[test]
fn the_previous_scan_leaves_no_trace() {
    let config = RasterConfig::default();
    let place = [Point2::new(20.0, 10.0)];
    let twist = Twist::from([12.0, 0.0, 0.2]);
    let navtech = Sensor::navtech();
    let other = Sensor {
        bins: 576,
        range_resolution_m: 0.1736,
        sense: Sense::CounterClockwise,
        ..Sensor::navtech()
    };
    let scans = [
        navtech.measure(&place, 1.0),
        other.measure(&place, 2.0),
        sensor(100, 2000).scan(),
    ];
    let mut rasteriser = Rasteriser::new(&config).unwrap();
    let mut reused = Array2::zeros((config.n, config.n));
    for (scan, twist) in [
        (0, None),
        (1, Some(twist)),
        (0, Some(twist)),
        (2, None),
        (0, None),
        (1, None),
    ] {
        rasteriser
            .rasterise(&scans[scan].view(), 0, twist, reused.view_mut())
            .unwrap();
        assert_eq!(
            reused.as_slice().unwrap(),
            raster(&config, &scans[scan], twist),
            "scan {scan}, {twist:?}"
        );
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(48))]
    #[test]
    fn any_azimuths_and_stamps_give_finite_rasters(
        azimuths in proptest::collection::vec((-10.0..10.0f32, -500_000_000..500_000_000i64), 1..40),
        bins in 1usize..300, resolution_m in 0.01..3.0f32, offset_m in -50.0..50.0f32,
        (vx, yaw_rate) in (-40.0..40.0f64, -4.0..4.0f64), bilinear: bool, moving: bool, floor: u8,
    ) {
        let mut scan = sensor(azimuths.len(), bins).scan();
        scan.bytes.fill(255);
        scan.geometry.range_resolution_m = resolution_m;
        scan.geometry.range_offset_m = offset_m;
        for (i, (azimuth, stamp)) in azimuths.into_iter().enumerate() {
            (scan.azimuth_rad[i], scan.stamp_ns[i]) = (azimuth, STAMP_NS + stamp);
        }
        let sampling = if bilinear { Sampling::Bilinear } else { Sampling::Averaged };
        let config = RasterConfig { sampling, ..small() };
        let twist = moving.then_some([vx, 0.0, yaw_rate].into());
        let mut out = Array2::from_elem((33, 33), f32::NAN);
        Rasteriser::new(&config).unwrap().rasterise(&scan.view(), floor, twist, out.view_mut()).unwrap();
        let most = f32::from(255 - floor);
        prop_assert!(out.iter().all(|power| (0.0..=most + 0.01).contains(power)));
    }
}
