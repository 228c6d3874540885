//! The radar on the vehicle.

use std::str::FromStr;

use gyre_geometry::{Pose, UncertainMotion, pose};
use nalgebra::{Matrix3, Vector2};

/// The pose of the radar in the frame of the vehicle. Written as `X,Y,YAW`: m forward, m to the
/// left, degrees counter-clockwise.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Mounting(Pose);

const NEEDED: &str =
    "three numbers are needed: m forward, m to the left, degrees counter-clockwise, as in 1.2,0,90";

impl FromStr for Mounting {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let numbers: Result<Vec<f64>, _> = text.split(',').map(|it| it.trim().parse()).collect();
        match numbers.as_deref() {
            Ok(&[x_m, y_m, yaw_deg]) if [x_m, y_m, yaw_deg].iter().all(|it| it.is_finite()) => {
                Ok(Self(pose(x_m, y_m, yaw_deg.to_radians())))
            }
            _ => Err(NEEDED.to_owned()),
        }
    }
}

impl Mounting {
    pub fn radar(&self) -> &Pose {
        &self.0
    }

    /// Returns the motion of the vehicle, in its own earlier frame, from the motion of the radar:
    /// `B M B^-1` with the radar's pose `B`.
    pub fn of_vehicle(&self, of_radar: &Pose) -> Pose {
        self.0 * of_radar * self.0.inverse()
    }

    /// Returns the motion of the vehicle with its covariance: the displacement is turned by the
    /// mounting, and an error in yaw moves the vehicle as far as the radar is from its origin.
    pub fn of_vehicle_uncertain(&self, of_radar: &UncertainMotion) -> UncertainMotion {
        let motion = self.of_vehicle(&of_radar.motion);
        let at = self.0.translation.vector;
        let moved = -(motion.rotation * Vector2::new(-at.y, at.x));
        let mut jacobian: Matrix3<f64> = self.0.rotation.to_homogeneous();
        (jacobian[(0, 2)], jacobian[(1, 2)]) = (moved.x, moved.y);
        UncertainMotion {
            motion,
            covariance: jacobian * of_radar.covariance * jacobian.transpose(),
        }
    }
}

#[cfg(test)]
mod tests {
    use std::f64::consts::{FRAC_PI_2, PI};

    use gyre_geometry::xy_yaw;
    use nalgebra::Vector3;

    use super::*;

    #[test]
    fn a_mounting_is_three_numbers() {
        let mounting: Mounting = "1.5, -0.2,180".parse().unwrap();
        let [x_m, y_m, yaw_rad] = xy_yaw(mounting.radar());
        assert_eq!((x_m, y_m), (1.5, -0.2));
        assert!((yaw_rad.abs() - PI).abs() < 1e-12);
        for text in ["", "1,2", "1,2,3,4", "ahead,0,0", "nan,0,0"] {
            assert!(text.parse::<Mounting>().is_err(), "{text}");
        }
    }

    #[test]
    fn a_radar_in_front_swings_out_where_the_vehicle_turns_on_the_spot() {
        let mounting: Mounting = "2,0,90".parse().unwrap();
        // The radar looks to the left: things ahead of the vehicle are to its right.
        let of_radar = mounting.0.inverse() * pose(0.0, 0.0, FRAC_PI_2) * mounting.0;
        let [x_m, y_m, yaw_rad] = xy_yaw(&mounting.of_vehicle(&of_radar));
        assert!(x_m.abs() < 1e-12 && y_m.abs() < 1e-12);
        assert!((yaw_rad - FRAC_PI_2).abs() < 1e-12);
    }

    #[test]
    fn the_covariance_is_that_of_small_errors_of_the_radars_motion() {
        let mounting: Mounting = "1.2,-0.4,35".parse().unwrap();
        let values = [3.0, 0.5, 0.8];
        let motion = |by: [f64; 3]| pose(values[0] + by[0], values[1] + by[1], values[2] + by[2]);
        let covariance = Matrix3::new(0.04, 0.01, 0.002, 0.01, 0.09, -0.001, 0.002, -0.001, 0.0004);
        let found = mounting.of_vehicle_uncertain(&UncertainMotion {
            motion: motion([0.0; 3]),
            covariance,
        });
        let step = 1e-6;
        let columns: Vec<Vector3<f64>> = (0..3)
            .map(|k| {
                let mut by = [0.0; 3];
                by[k] = step;
                let end = |by| Vector3::from(xy_yaw(&mounting.of_vehicle(&motion(by))));
                (end(by) - end([0.0; 3])) / step
            })
            .collect();
        let jacobian = Matrix3::from_columns(&columns);
        let expected = jacobian * covariance * jacobian.transpose();
        assert!(
            (found.covariance - expected).norm() < 1e-6,
            "{found:?} {expected}"
        );
    }
}
