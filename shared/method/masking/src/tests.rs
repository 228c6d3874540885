use super::*;
use gyre_geometry::OwnedScan;
use ndarray::Array2;

#[path = "../tests/common/sweep.rs"]
mod sweep;

pub(crate) const AZIMUTHS: usize = 400;
const BINS: usize = 300;

/// An empty scan of a sweep of 0.25 s.
pub(crate) fn empty(bins: usize) -> OwnedScan {
    sweep::of(AZIMUTHS, bins, 0.2)
}

/// A scan of a circular wall, 4 m deep, with its middle at 40 m. All rows have one time.
fn wall() -> OwnedScan {
    let mut scan = empty(BINS);
    scan.stamp_ns.fill(0);
    let rows = scan.bytes.chunks_mut(BINS);
    rows.for_each(|row| row[190..210].fill(100));
    scan
}

/// The mean range of the power straight ahead at 20 m/s, m.
fn wall_ahead_m(config: &MaskingConfig) -> f32 {
    let raster = RasterConfig::of(401, 0.25);
    let mut masker = Masker::new(&raster, &PointsConfig::default(), config).unwrap();
    let twist = Twist::from([20.0, 0.0, 0.0]);
    let mut cells = Array2::zeros((401, 401));
    let wall = wall();
    let sweep = Sweep {
        number: 0,
        scan: wall.view(),
        twist: Some(twist),
    };
    assert!(masker.mask(&sweep, None, cells.view_mut(), None).unwrap() == Some(twist));
    let ahead = (0..200).map(|row| (cells[[row, 200]], (200 - row) as f32 * 0.25));
    let (sum, moment) = ahead.fold((0.0, 0.0), |(sum, moment), (power, x_m)| {
        (sum + power, moment + power * x_m)
    });
    moment / sum
}

#[test]
fn rasters_keep_the_doppler_shift_unless_compensation_is_configured() {
    let kept = wall_ahead_m(&MaskingConfig::default());
    let compensated = wall_ahead_m(&MaskingConfig {
        undo_doppler: true,
        ..MaskingConfig::default()
    });
    assert!((kept - 40.0).abs() < 0.1, "{kept}");
    assert!(
        (compensated - kept - 0.04 * 20.0).abs() < 0.02,
        "{compensated}, {kept} with the shift"
    );
}

#[test]
fn points_start_above_the_threshold() {
    let count = |config: &MaskingConfig| {
        let points = PointsConfig {
            capacity: 20_000,
            ..PointsConfig::default()
        };
        let mut masker = Masker::new(&RasterConfig::default(), &points, config).unwrap();
        let mut out = vec![SparsePoint::default(); points.capacity];
        let count = masker.points(&wall().view(), None, &mut out).unwrap();
        (count, out[0].weight)
    };
    let default = count(&MaskingConfig::default());
    assert_eq!(default, (20 * AZIMUTHS, 40.0 / 60.0));
    let high = MaskingConfig {
        threshold: 100,
        ..MaskingConfig::default()
    };
    assert_eq!(count(&high).0, 0);
    let none = MaskingConfig {
        kind: MaskKind::None,
        ..MaskingConfig::default()
    };
    assert_eq!(count(&none), (20 * AZIMUTHS, 1.0));
}
