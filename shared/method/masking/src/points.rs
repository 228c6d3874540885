//! The mask's factors on sparse points.

use gyre_geometry::{Pose, SparsePoint, Twist};
use nalgebra::Point2;
use ndarray::ArrayView2;

/// The properties of a raster that determine a point's cell.
#[derive(Clone, Copy, Debug)]
pub(crate) struct RasterFrame {
    pub n: usize,
    pub cell_m: f32,
    pub twist: Option<Twist>,
    /// True if the Doppler shift is compensated with the same velocity.
    pub doppler_compensated: bool,
}

impl RasterFrame {
    /// Multiplies the weight of each point by the mask at its cell raised to `exponent`. Points
    /// outside of the raster keep their weights.
    pub fn weight(&self, mask: ArrayView2<'_, f32>, exponent: f32, points: &mut [SparsePoint]) {
        // All points of an azimuth have the same time.
        for points in points.chunk_by_mut(|a, b| a.time_s == b.time_s) {
            let sensor = self.sensor_at(&points[0]);
            for point in points {
                let factor = self
                    .cell_seen_from(sensor, point)
                    .map(|cell| mask[cell].powf(exponent));
                point.weight *= factor.unwrap_or(1.0);
            }
        }
    }

    pub fn cell_of(&self, point: &SparsePoint) -> Option<[usize; 2]> {
        self.cell_seen_from(self.sensor_at(point), point)
    }

    fn sensor_at(&self, point: &SparsePoint) -> Option<Pose> {
        self.twist.map(|twist| twist.pose_at(point.time_s.into()))
    }

    fn cell_seen_from(&self, sensor: Option<Pose>, point: &SparsePoint) -> Option<[usize; 2]> {
        let seen = Point2::new(f64::from(point.x_m), f64::from(point.y_m));
        let place = self.without_doppler(seen, point.doppler_s.into());
        self.cell(sensor.map_or(place, |sensor| sensor * place))
    }

    /// Returns the position of a point, without its Doppler shift if the raster is compensated for
    /// it: see [`SparsePoint`].
    fn without_doppler(&self, seen: Point2<f64>, doppler_s: f64) -> Point2<f64> {
        match self.twist.filter(|_| self.doppler_compensated) {
            Some(twist) => {
                let range_m = seen.coords.norm().max(f64::MIN_POSITIVE);
                let approach_mps = (twist.vx_mps * seen.x + twist.vy_mps * seen.y) / range_m;
                seen + seen.coords * (doppler_s * approach_mps / range_m)
            }
            None => seen,
        }
    }

    fn cell(&self, place: Point2<f64>) -> Option<[usize; 2]> {
        let index = |metres: f64| {
            let index = (0.5 * (self.n as f64 - 1.0) - metres / f64::from(self.cell_m)).round();
            (0.0..self.n as f64)
                .contains(&index)
                .then_some(index as usize)
        };
        Some([index(place.x)?, index(place.y)?])
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tests::{AZIMUTHS, empty};
    use gyre_geometry::{OwnedScan, Sense};
    use gyre_radar::{PointExtractor, PointsConfig, RasterConfig, raster::Rasteriser};
    use ndarray::Array2;

    const BINS: usize = 500;

    /// A return in every twentieth azimuth, at ranges from 15 to 80 m, seen within 0.25 s.
    fn spots(sense: Sense) -> OwnedScan {
        let mut scan = empty(BINS);
        let geometry = &mut scan.geometry;
        (geometry.range_resolution_m, geometry.doppler_s) = (0.175, 0.05);
        geometry.sense = sense;
        for azimuth in (5..AZIMUTHS).step_by(20) {
            scan.bytes[azimuth * BINS + 90 + azimuth * 7 % 360..][..6].fill(200);
        }
        scan
    }

    /// Returns the share of a scan's points that `frame` places in cells with power in the raster
    /// made with `twist`.
    fn share_that_meets(twist: Twist, sense: Sense, frame: RasterFrame) -> f32 {
        let scan = spots(sense);
        let config = RasterConfig::of(frame.n, frame.cell_m);
        let mut raster = Array2::zeros((frame.n, frame.n));
        Rasteriser::new(&config)
            .unwrap()
            .rasterise(&scan.view(), 60, Some(twist), raster.view_mut())
            .unwrap();
        let mut points = vec![SparsePoint::default(); 8192];
        let config = PointsConfig {
            max_range_m: 100.0,
            ..PointsConfig::default()
        };
        let count = PointExtractor::new(&config)
            .unwrap()
            .extract(&scan.view(), 60, &mut points)
            .unwrap();
        assert!(count >= 100, "{count}");
        let lit = raster.mapv(|power: f32| f32::from(power > 10.0));
        let mut weighted = points[..count].to_vec();
        frame.weight(lit.view(), 1.0, &mut weighted);
        weighted.iter().filter(|point| point.weight > 0.0).count() as f32 / count as f32
    }

    #[test]
    fn points_lie_in_cells_with_power() {
        let twist = Twist::from([25.0, 1.0, 0.6]);
        let moving = RasterFrame {
            n: 401,
            cell_m: 0.5,
            twist: Some(twist),
            doppler_compensated: true,
        };
        for sense in [Sense::Clockwise, Sense::CounterClockwise] {
            let share = share_that_meets(twist, sense, moving);
            assert!(share > 0.99, "{share}");
            for other in [
                RasterFrame {
                    doppler_compensated: false,
                    ..moving
                },
                RasterFrame {
                    twist: None,
                    ..moving
                },
            ] {
                let share = share_that_meets(twist, sense, other);
                assert!(share < 0.8, "{share} for {other:?}");
            }
        }
    }
}
