//! The filter of a track: interacting multiple models (Blom and Bar-Shalom, "The interacting
//! multiple model algorithm for systems with Markovian switching coefficients", 1988). Each model
//! is a Kalman filter of position and velocity with a turn rate of its own, so that the motion is
//! linear (Bar-Shalom, Li and Kirubarajan, "Estimation with Applications to Tracking and
//! Navigation", 2001, Sec. 11.7.1).

use nalgebra::{Matrix2, Matrix2x4, Matrix4, Point2, SMatrix, SVector, Vector2, Vector4};

use crate::detector::Detection;

/// Turn rates of the models over the largest one.
const TURNS: [f64; 5] = [-1.0, -0.5, 0.0, 0.5, 1.0];
/// Their shares of the time: vehicles drive straight for most of it.
const SHARES: [f64; 5] = [0.075, 0.075, 0.7, 0.075, 0.075];

/// Largest turn rate, rad/s: a car turns off at 7 m/s on a radius of 10 m.
const TURN_RATE_RADPS: f64 = 0.7;
/// Mean time for which a turn rate lasts, s: a driver steers into a corner, and out of it, in about
/// that.
const TURN_LASTS_S: f64 = 0.5;
/// Standard deviation of an object's acceleration along its way, m/s²: vehicles brake and
/// accelerate with 1 to 3.
const ACCELERATION_MPS2: f64 = 1.5;
/// Standard deviation of its lateral acceleration beyond the acceleration of a turn, m/s²: a lane
/// change has about 1.
const LATERAL_ACCELERATION_MPS2: f64 = 1.0;

/// An object that stood may be detected this far behind its place, m: less than its length.
const BEHIND_M: f64 = 4.0;

#[derive(Clone, Copy, Debug)]
pub(crate) struct Filter {
    models: [Model; TURNS.len()],
    mean: Estimate,
}

#[derive(Clone, Copy, Debug)]
struct Model {
    probability: f64,
    estimate: Estimate,
}

/// x, y (m), and their velocities (m/s).
#[derive(Clone, Copy, Debug)]
struct Estimate {
    state: Vector4<f64>,
    covariance: Matrix4<f64>,
}

#[derive(Clone, Copy, Debug)]
pub(crate) struct Innovation {
    /// Measured less predicted, m.
    difference: Vector2<f64>,
    covariance: Matrix2<f64>,
    jacobian: Matrix2x4<f64>,
    noise: Matrix2<f64>,
}

impl Innovation {
    pub fn chi_square(&self) -> f64 {
        mahalanobis(self.difference, self.covariance)
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
    pub fn new(detection: &Detection, speed_sigma_mps: f64) -> Self {
        let (at, by_velocity) = (detection.at, &detection.by_velocity);
        let variance = speed_sigma_mps.powi(2);
        let mut covariance = Matrix4::from_diagonal_element(variance);
        let position = detection.noise() + by_velocity * by_velocity.transpose() * variance;
        covariance.fixed_view_mut::<2, 2>(0, 0).copy_from(&position);
        let both = -by_velocity * variance;
        covariance.fixed_view_mut::<2, 2>(0, 2).copy_from(&both);
        covariance
            .fixed_view_mut::<2, 2>(2, 0)
            .copy_from(&both.transpose());
        let estimate = Estimate {
            state: Vector4::new(at.x, at.y, 0.0, 0.0),
            covariance,
        };
        Self {
            models: SHARES.map(|probability| Model {
                probability,
                estimate,
            }),
            mean: estimate,
        }
    }

    pub fn position(&self) -> Point2<f64> {
        Point2::new(self.mean.state[0], self.mean.state[1])
    }

    pub fn velocity(&self) -> Vector2<f64> {
        Vector2::new(self.mean.state[2], self.mean.state[3])
    }

    pub fn position_covariance(&self) -> Matrix2<f64> {
        self.mean.covariance.fixed_view::<2, 2>(0, 0).into()
    }

    pub fn velocity_covariance(&self) -> Matrix2<f64> {
        self.mean.covariance.fixed_view::<2, 2>(2, 2).into()
    }

    /// Returns the speed, and the standard deviation of the velocity in its direction, m/s.
    pub fn speed(&self) -> (f64, f64) {
        let velocity = self.velocity();
        let along = velocity.try_normalize(1e-9).unwrap_or_else(Vector2::x);
        let variance = (along.transpose() * self.velocity_covariance() * along)[0];
        (velocity.norm(), variance.max(0.0).sqrt())
    }

    /// Predicts the state some seconds later. `heading` is a unit vector, along and across which
    /// the acceleration is uncertain.
    pub fn predict(&mut self, dt_s: f64, heading: &Vector2<f64>) {
        let before = self.models;
        let kept = (-dt_s / TURN_LASTS_S).exp();
        let noise = acceleration_noise(dt_s, heading);
        for (index, model) in self.models.iter_mut().enumerate() {
            // A model continues, or any of them begins.
            let from = |other: usize| {
                let stays = if other == index { kept } else { 0.0 };
                before[other].probability * (stays + (1.0 - kept) * SHARES[index])
            };
            model.probability = (0..before.len()).map(from).sum();
            model.estimate = mixture((0..before.len()).map(|o| (from(o), &before[o].estimate)));
            let turn_rate_radps = TURNS[index] * TURN_RATE_RADPS;
            model.estimate.predict(dt_s, turn_rate_radps, &noise);
        }
        self.combine();
    }

    pub fn innovation(&self, detection: &Detection) -> Innovation {
        self.mean.innovation(detection)
    }

    pub fn update(&mut self, detection: &Detection) {
        let innovations = self
            .models
            .map(|model| model.estimate.innovation(detection));
        for (model, innovation) in self.models.iter_mut().zip(&innovations) {
            model.estimate.update(innovation);
        }
        self.weigh(&innovations.map(|innovation| innovation.cost()));
    }

    /// Updates the state by a heading, a unit vector, across which the velocity is zero but for a
    /// standard deviation: a vehicle drives where it points to.
    pub fn align(&mut self, heading: &Vector2<f64>, sigma_mps: f64) {
        self.measure(&Vector2::new(-heading.y, heading.x), 0.0, sigma_mps);
    }

    /// Updates the state by the velocity in a direction, a unit vector, with a standard deviation.
    pub fn measure(&mut self, direction: &Vector2<f64>, wanted_mps: f64, sigma_mps: f64) {
        let along = Vector4::new(0.0, 0.0, direction.x, direction.y);
        let variance = |estimate: &Estimate| {
            (along.transpose() * estimate.covariance * along)[0] + sigma_mps.powi(2)
        };
        let off_mps = |estimate: &Estimate| wanted_mps - along.dot(&estimate.state);
        let costs = self.models.map(|model| {
            let variance = variance(&model.estimate);
            off_mps(&model.estimate).powi(2) / variance + variance.ln()
        });
        for model in &mut self.models {
            let estimate = &mut model.estimate;
            let gain = estimate.covariance * along / variance(estimate);
            estimate.state += gain * off_mps(estimate);
            let rest = Matrix4::identity() - gain * along.transpose();
            estimate.covariance = rest * estimate.covariance * rest.transpose()
                + gain * gain.transpose() * sigma_mps.powi(2);
        }
        self.weigh(&costs);
    }

    pub fn apart(&self, other: &Self) -> f64 {
        let difference = self.mean.state - other.mean.state;
        mahalanobis(difference, self.mean.covariance + other.mean.covariance)
    }

    /// Returns the squared Mahalanobis distance between this object, which stood, and the place
    /// where the other object began to drive, if that object reached its speed with the usual
    /// acceleration. It is infinite for one that has yet to come to that place.
    pub fn apart_from_start(&self, started: &Self) -> f64 {
        let velocity = started.velocity();
        let ahead = started.position() - self.position();
        if ahead.dot(&velocity) < -BEHIND_M * velocity.norm() {
            return f64::INFINITY;
        }
        let way_s = velocity.norm() / (2.0 * ACCELERATION_MPS2);
        let way = velocity * way_s;
        let difference = ahead - way;
        // The way is as uncertain as the acceleration: by half of it.
        let covariance = self.position_covariance()
            + started.position_covariance()
            + way * way.transpose() * 0.25;
        mahalanobis(difference, covariance)
    }

    /// Weighs the models by minus twice the logarithms of their likelihoods.
    fn weigh(&mut self, costs: &[f64; TURNS.len()]) {
        let least = costs.iter().copied().fold(f64::INFINITY, f64::min);
        for (model, cost) in self.models.iter_mut().zip(costs) {
            model.probability *= (-0.5 * (cost - least)).exp();
        }
        let sum: f64 = self.models.iter().map(|model| model.probability).sum();
        for (model, share) in self.models.iter_mut().zip(SHARES) {
            // A cost is infinite where no noise is above zero: then nothing is known of the turn.
            model.probability = match sum > f64::MIN_POSITIVE {
                true => model.probability / sum,
                false => share,
            };
        }
        self.combine();
    }

    fn combine(&mut self) {
        let models = self.models.iter();
        self.mean = mixture(models.map(|model| (model.probability, &model.estimate)));
    }
}

impl Estimate {
    fn predict(&mut self, dt_s: f64, turn_rate_radps: f64, noise: &Matrix4<f64>) {
        let turned = turn_rate_radps * dt_s;
        let (sin, cos) = turned.sin_cos();
        let (along, aside) = match turned.abs() < 1e-9 {
            true => (dt_s, 0.0),
            false => (sin / turn_rate_radps, (1.0 - cos) / turn_rate_radps),
        };
        #[rustfmt::skip]
        let step = Matrix4::new(
            1.0, 0.0, along, -aside,
            0.0, 1.0, aside, along,
            0.0, 0.0, cos, -sin,
            0.0, 0.0, sin, cos,
        );
        self.state = step * self.state;
        self.covariance = step * self.covariance * step.transpose() + noise;
    }

    fn innovation(&self, detection: &Detection) -> Innovation {
        let mut jacobian = Matrix2x4::zeros();
        jacobian
            .fixed_view_mut::<2, 2>(0, 0)
            .copy_from(&Matrix2::identity());
        jacobian
            .fixed_view_mut::<2, 2>(0, 2)
            .copy_from(&detection.by_velocity);
        let noise = detection.noise();
        Innovation {
            difference: detection.at.coords - jacobian * self.state,
            covariance: jacobian * self.covariance * jacobian.transpose() + noise,
            jacobian,
            noise,
        }
    }

    /// A singular covariance, which no noise above zero gives, changes nothing.
    fn update(&mut self, innovation: &Innovation) {
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

fn mixture<'a>(parts: impl Iterator<Item = (f64, &'a Estimate)> + Clone) -> Estimate {
    let sum: f64 = parts.clone().map(|(weight, _)| weight).sum();
    let sum = sum.max(f64::MIN_POSITIVE);
    let state = parts
        .clone()
        .fold(Vector4::zeros(), |mean, (weight, part)| {
            mean + part.state * (weight / sum)
        });
    let covariance = parts.fold(Matrix4::zeros(), |covariance, (weight, part)| {
        let apart = part.state - state;
        covariance + (part.covariance + apart * apart.transpose()) * (weight / sum)
    });
    Estimate { state, covariance }
}

pub(crate) fn mahalanobis<const N: usize>(
    difference: SVector<f64, N>,
    covariance: SMatrix<f64, N, N>,
) -> f64 {
    covariance.try_inverse().map_or(f64::INFINITY, |inverse| {
        (difference.transpose() * inverse * difference)[0]
    })
}

/// The covariance of an acceleration that is constant for some seconds.
fn acceleration_noise(dt_s: f64, heading: &Vector2<f64>) -> Matrix4<f64> {
    let [along, across] = [ACCELERATION_MPS2, LATERAL_ACCELERATION_MPS2].map(|sigma| sigma * sigma);
    let side = Vector2::new(-heading.y, heading.x);
    let power = heading * heading.transpose() * along + side * side.transpose() * across;
    let mut noise = Matrix4::zeros();
    for (row, column, factor) in [
        (0, 0, dt_s.powi(4) / 4.0),
        (0, 2, dt_s.powi(3) / 2.0),
        (2, 0, dt_s.powi(3) / 2.0),
        (2, 2, dt_s.powi(2)),
    ] {
        noise
            .fixed_view_mut::<2, 2>(row, column)
            .copy_from(&(power * factor));
    }
    noise
}

#[cfg(test)]
mod tests;
