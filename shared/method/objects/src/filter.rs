//! The Kalman filter of a track: position and velocity, with white noise of the acceleration, more
//! or less along the way and across it.

use nalgebra::{Matrix2, Matrix2x4, Matrix4, Point2, Vector2, Vector4};

use crate::clusters::Measurement;

/// Position and velocity with their covariance.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Filter {
    /// x, y (m), and their velocities (m/s).
    state: Vector4<f64>,
    covariance: Matrix4<f64>,
}

/// The difference of a measurement to what was predicted.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Innovation {
    /// Measured less predicted, m.
    pub difference: Vector2<f64>,
    /// Covariance of that, m².
    pub covariance: Matrix2<f64>,
    jacobian: Matrix2x4<f64>,
    noise: Matrix2<f64>,
}

impl Innovation {
    /// Returns the squared Mahalanobis distance; infinite for a covariance that is singular.
    pub fn chi_square(&self) -> f64 {
        let inverse = self.covariance.try_inverse();
        inverse.map_or(f64::INFINITY, |inverse| {
            (self.difference.transpose() * inverse * self.difference)[0]
        })
    }

    /// Returns minus twice the logarithm of the likelihood, but for a constant: with it a track
    /// whose prediction is certain wins against one that fits anything.
    pub fn cost(&self) -> f64 {
        self.chi_square() + self.covariance.determinant().max(f64::MIN_POSITIVE).ln()
    }
}

impl Filter {
    /// Starts at a measurement, with a velocity of zero that is as good as unknown: where it was at
    /// the scan's time depends on it.
    pub fn new(measured: &Measurement, noise: &Matrix2<f64>, speed_sigma_mps: f64) -> Self {
        let at = &measured.at;
        let (by_velocity, variance) = (by_velocity(measured), speed_sigma_mps.powi(2));
        let mut covariance = Matrix4::from_diagonal_element(variance);
        let position = noise + by_velocity * by_velocity.transpose() * variance;
        covariance.fixed_view_mut::<2, 2>(0, 0).copy_from(&position);
        let both = -by_velocity * variance;
        covariance.fixed_view_mut::<2, 2>(0, 2).copy_from(&both);
        covariance
            .fixed_view_mut::<2, 2>(2, 0)
            .copy_from(&both.transpose());
        Self {
            state: Vector4::new(at.x, at.y, 0.0, 0.0),
            covariance,
        }
    }

    /// Returns the position, m.
    pub fn position(&self) -> Point2<f64> {
        Point2::new(self.state[0], self.state[1])
    }

    /// Returns the velocity, m/s.
    pub fn velocity(&self) -> Vector2<f64> {
        Vector2::new(self.state[2], self.state[3])
    }

    /// Returns the covariance of the position, m².
    pub fn position_covariance(&self) -> Matrix2<f64> {
        self.covariance.fixed_view::<2, 2>(0, 0).into()
    }

    /// Returns the covariance of the velocity, (m/s)².
    pub fn velocity_covariance(&self) -> Matrix2<f64> {
        self.covariance.fixed_view::<2, 2>(2, 2).into()
    }

    /// Returns the speed, and the standard deviation of the velocity in its direction, m/s.
    pub fn speed(&self) -> (f64, f64) {
        let velocity = self.velocity();
        let along = velocity.try_normalize(1e-9).unwrap_or_else(Vector2::x);
        let variance = (along.transpose() * self.velocity_covariance() * along)[0];
        (velocity.norm(), variance.max(0.0).sqrt())
    }

    /// Predicts the state some seconds later. `heading` is a unit vector; the accelerations are
    /// standard deviations along it and across it, m/s².
    pub fn predict(&mut self, dt_s: f64, heading: &Vector2<f64>, accelerations_mps2: [f64; 2]) {
        let mut step = Matrix4::identity();
        (step[(0, 2)], step[(1, 3)]) = (dt_s, dt_s);
        let [along, across] = accelerations_mps2.map(|sigma| sigma * sigma);
        let side = Vector2::new(-heading.y, heading.x);
        let power = heading * heading.transpose() * along + side * side.transpose() * across;
        let mut noise = Matrix4::zeros();
        let block = |factor: f64| power * factor;
        noise
            .fixed_view_mut::<2, 2>(0, 0)
            .copy_from(&block(dt_s.powi(4) / 4.0));
        noise
            .fixed_view_mut::<2, 2>(0, 2)
            .copy_from(&block(dt_s.powi(3) / 2.0));
        noise
            .fixed_view_mut::<2, 2>(2, 0)
            .copy_from(&block(dt_s.powi(3) / 2.0));
        noise
            .fixed_view_mut::<2, 2>(2, 2)
            .copy_from(&block(dt_s.powi(2)));
        self.state = step * self.state;
        self.covariance = step * self.covariance * step.transpose() + noise;
    }

    /// Compares with a measurement, whose place `at` was seen at its own time, and lengthened or
    /// shortened by the Doppler shift of the object.
    pub fn innovation(
        &self,
        measured: &Measurement,
        at: &Point2<f64>,
        noise: &Matrix2<f64>,
    ) -> Innovation {
        let mut jacobian = Matrix2x4::zeros();
        jacobian
            .fixed_view_mut::<2, 2>(0, 0)
            .copy_from(&Matrix2::identity());
        jacobian
            .fixed_view_mut::<2, 2>(0, 2)
            .copy_from(&by_velocity(measured));
        Innovation {
            difference: at.coords - jacobian * self.state,
            covariance: jacobian * self.covariance * jacobian.transpose() + noise,
            jacobian,
            noise: *noise,
        }
    }

    /// Updates the state by a measurement. A singular covariance, which no noise above zero gives,
    /// changes nothing.
    pub fn update(&mut self, innovation: &Innovation) {
        let Some(inverse) = innovation.covariance.try_inverse() else {
            return;
        };
        let jacobian = &innovation.jacobian;
        let gain = self.covariance * jacobian.transpose() * inverse;
        self.state += gain * innovation.difference;
        // Joseph's form: symmetric and positive whatever the rounding.
        let rest = Matrix4::identity() - gain * jacobian;
        self.covariance =
            rest * self.covariance * rest.transpose() + gain * innovation.noise * gain.transpose();
    }
}

/// The change of a measured place by the velocity: it is seen at its own time, and lengthened or
/// shortened by the Doppler shift.
fn by_velocity(measured: &Measurement) -> Matrix2<f64> {
    let away = measured.direction;
    Matrix2::identity() * measured.time_s + away * away.transpose() * measured.doppler_s
}
