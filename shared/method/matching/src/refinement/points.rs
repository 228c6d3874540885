//! Deskewing: a scan's points in the sensor's frame at the scan's stamp.

use gyre_geometry::{Pose, SparsePoint, Twist};
use gyre_simd::simd;
use nalgebra::Point2;

/// The points of a scan in the sensor's frame at its stamp, as three columns.
#[derive(Debug, Default)]
pub(crate) struct DeskewedPoints {
    pub x_m: Vec<f32>,
    pub y_m: Vec<f32>,
    pub weight: Vec<f32>,
}

impl DeskewedPoints {
    pub fn with_capacity(points: usize) -> Self {
        let column = || Vec::with_capacity(points);
        Self {
            x_m: column(),
            y_m: column(),
            weight: column(),
        }
    }

    /// Moves each point from the sensor's frame at the point's time to that at the stamp, at
    /// constant velocity.
    pub fn deskew(&mut self, points: &[SparsePoint], twist: &Twist) {
        for column in self.columns() {
            column.clear();
            column.resize(points.len(), 0.0);
        }
        deskew(
            points,
            [twist.vx_mps, twist.vy_mps, twist.yaw_rate_radps].map(|v| v as f32),
            &mut self.x_m,
            &mut self.y_m,
            &mut self.weight,
        );
    }

    pub fn thin(&mut self, stride: usize) {
        for column in self.columns() {
            let count = column.len().div_ceil(stride);
            (0..count).for_each(|k| column[k] = column[k * stride]);
            column.truncate(count);
        }
    }

    pub fn clear(&mut self) {
        self.columns().into_iter().for_each(Vec::clear);
    }

    pub fn extend(&mut self, points: &Self, pose: &Pose) {
        let places = points.x_m.iter().zip(&points.y_m);
        for (&x_m, &y_m) in places {
            let place = pose * Point2::new(f64::from(x_m), f64::from(y_m));
            self.x_m.push(place.x as f32);
            self.y_m.push(place.y as f32);
        }
        self.weight.extend_from_slice(&points.weight);
    }

    fn columns(&mut self) -> [&mut Vec<f32>; 3] {
        [&mut self.x_m, &mut self.y_m, &mut self.weight]
    }

    pub fn total_weight(&self) -> f64 {
        self.weight.iter().map(|w| f64::from(*w)).sum()
    }

    /// The mean of the weights, weighted by themselves.
    pub fn mean_weight(&self) -> f64 {
        self.weight
            .iter()
            .map(|w| f64::from(*w).powi(2))
            .sum::<f64>()
            / self.total_weight()
    }
}

/// The sensor's pose at time t: the chord v t turned by half the angle, and the whole angle
/// ([`Twist::chord_pose_at`]).
#[simd]
fn deskew(
    points: &[SparsePoint],
    [vx, vy, rate]: [f32; 3],
    x_m: &mut [f32],
    y_m: &mut [f32],
    weight: &mut [f32],
) {
    let places = x_m.iter_mut().zip(y_m).zip(weight);
    for (point, ((x_m, y_m), weight)) in points.iter().zip(places) {
        let SparsePoint {
            x_m: x,
            y_m: y,
            time_s: t,
            weight: w,
            doppler_s: doppler,
        } = *point;
        // The Doppler shift along the line of sight u: r + doppler (u . v), so x + doppler (u . v)
        // u.
        let toward = doppler * (x * vx + y * vy) / (x * x + y * y).max(1e-6);
        let (x, y) = (x + toward * x, y + toward * y);
        let (sin, cos) = sin_cos(rate * t);
        let (half_sin, half_cos) = sin_cos(0.5 * rate * t);
        let (ahead, aside) = (vx * t, vy * t);
        *x_m = half_cos * ahead - half_sin * aside + cos * x - sin * y;
        *y_m = half_sin * ahead + half_cos * aside + sin * x + cos * y;
        // A weight that is NaN counts as 0.
        *weight = if w > 0.0 { w.min(1.0) } else { 0.0 };
    }
}

/// Sine and cosine by their series, to 2e-6 within half a radian: no vehicle turns more in a sweep.
#[inline(always)]
fn sin_cos(a: f32) -> (f32, f32) {
    let s = a * a;
    (
        a * (1.0 - s / 6.0 * (1.0 - s / 20.0 * (1.0 - s / 42.0))),
        1.0 - s / 2.0 * (1.0 - s / 12.0 * (1.0 - s / 30.0)),
    )
}

#[cfg(test)]
mod tests {
    use nalgebra::{Isometry2, Vector2};
    use proptest::prelude::*;

    use super::*;

    fn twist(vx_mps: f64, vy_mps: f64, yaw_rate_radps: f64) -> Twist {
        Twist {
            vx_mps,
            vy_mps,
            yaw_rate_radps,
        }
    }

    proptest! {
        #[test]
        fn a_point_lies_where_the_sensor_on_its_arc_saw_it(
            v in prop::array::uniform2(-20.0_f64..20.0), rate in -2.0_f64..2.0, t in -0.125_f64..0.125,
            at in prop::array::uniform2(-90.0_f64..90.0),
        ) {
            let mut points = DeskewedPoints::default();
            points.deskew(&[[at[0] as f32, at[1] as f32, t as f32, 0.5, 0.0].into()], &twist(v[0], v[1], rate));
            // The arc in a thousand straight steps, each along the heading in its middle.
            let (steps, mut pose) = (1000, Isometry2::identity());
            let dt = t / f64::from(steps);
            for _ in 0..steps {
                let half = Isometry2::rotation(0.5 * rate * dt);
                pose = pose * half * Isometry2::new(Vector2::new(v[0], v[1]) * dt, 0.0) * half;
            }
            let expected = pose * Point2::new(at[0], at[1]);
            // The chord is assumed as long as the arc: off by the turn squared over 24.
            let slack = 1e-3 + (v[0].hypot(v[1]) * t.abs()) * (rate * t).powi(2) / 20.0;
            prop_assert!((f64::from(points.x_m[0]) - expected.x).abs() < slack);
            prop_assert!((f64::from(points.y_m[0]) - expected.y).abs() < slack);
        }
    }

    #[test]
    fn doppler_shifts_are_added_to_the_ranges_of_approaching_points() {
        let mut points = DeskewedPoints::default();
        let ahead_and_aside = [
            [30.0, 0.0, 0.0, 1.0, 0.05],
            [0.0, 30.0, 0.0, 1.0, 0.05],
            [-30.0, 0.0, 0.0, 1.0, 0.05],
        ]
        .map(SparsePoint::from);
        points.deskew(&ahead_and_aside, &twist(10.0, 0.0, 0.0));
        assert_eq!(points.x_m, [30.5, 0.0, -29.5]);
        assert_eq!(points.y_m, [0.0, 30.0, 0.0]);
    }
}
