//! Hills: the height of the ground.

use nalgebra::{Point2, Vector2};

use crate::place_noise::smooth_noise;

/// Hills and humps: scale and standard deviation of the height, metres. Assumed; the road has a
/// gradient of 2.6 % RMS.
const HILLS: [(f64, f64); 2] = [(250.0, 3.0), (60.0, 0.5)];
/// Where the hills are, metres: no drive begins at a place that is special to them.
const SHIFT_M: (f64, f64) = (97.0, 161.0);
/// Half of a car's wheelbase, metres, over which its body levels the ground.
const HALF_WHEELBASE_M: f64 = 1.4;

/// The height of the ground by place.
#[derive(Clone, Copy, Debug, Default)]
pub struct Relief {
    seed: Option<u64>,
}

impl Relief {
    /// Level ground.
    pub const LEVEL: Self = Self { seed: None };

    /// Hills; the same for the same seed.
    pub fn hills(seed: u64) -> Self {
        Self { seed: Some(seed) }
    }

    /// Returns whether the ground is level everywhere.
    pub fn is_level(&self) -> bool {
        self.seed.is_none()
    }

    /// Height of the ground at a place, metres.
    pub fn height_m(&self, place: Point2<f64>) -> f64 {
        let Some(seed) = self.seed else { return 0.0 };
        let place = place + Vector2::new(SHIFT_M.0, SHIFT_M.1);
        let height_m = |(number, (size_m, deviation_m)): (u64, (f64, f64))| {
            deviation_m
                * smooth_noise(
                    place,
                    size_m,
                    seed.wrapping_mul(0x1_0001).wrapping_add(number),
                )
        };
        (0..).zip(HILLS).map(height_m).sum()
    }

    /// Height of one place above another, metres.
    pub fn rise_m(&self, from: Point2<f64>, to: Point2<f64>) -> f64 {
        if self.seed.is_none() {
            return 0.0;
        }
        self.height_m(to) - self.height_m(from)
    }

    /// Gradient of a vehicle at a place in a direction (a unit vector), radians upwards.
    pub fn slope_rad(&self, place: Point2<f64>, direction: Vector2<f64>) -> f64 {
        let reach = direction * HALF_WHEELBASE_M;
        self.rise_m(place - reach, place + reach) / (2.0 * HALF_WHEELBASE_M)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_ground_has_the_stated_gradient_and_level_ground_has_none() {
        let hills = Relief::hills(5);
        let place = |i: u32| Point2::new(f64::from(i) * 37.0, f64::from(i % 89) * 53.0);
        let slopes = (0..20_000).map(|i| hills.slope_rad(place(i), Vector2::x()));
        let spread = (slopes.map(|slope| slope * slope).sum::<f64>() / 20_000.0).sqrt();
        assert!((0.022..0.031).contains(&spread), "{spread}");
        assert_eq!(Relief::LEVEL.slope_rad(place(3), Vector2::x()), 0.0);
        assert_eq!(Relief::LEVEL.rise_m(place(3), place(9)), 0.0);
    }
}
