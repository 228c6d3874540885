//! The filter of a track: interacting multiple models (Blom and Bar-Shalom, "The interacting
//! multiple model algorithm for systems with Markovian switching coefficients", 1988), each a
//! Kalman filter of position and velocity that turns at a rate of its own.
//!
//! With a known turn rate the motion is linear in position and velocity (Bar-Shalom, Li and
//! Kirubarajan, "Estimation with Applications to Tracking and Navigation", 2001, Sec. 11.7.1): no
//! model is linearised, and a vehicle that stops has no heading to lose. Which turn rate it is
//! follows from how well each predicts, and what is not known of it is in the covariance.

use nalgebra::{Matrix2, Matrix2x4, Matrix4, Point2, Vector2, Vector4};

use crate::ObjectsConfig;

/// Turn rates of the models over the largest one.
const TURNS: [f64; 5] = [-1.0, -0.5, 0.0, 0.5, 1.0];
/// Their shares of the time: vehicles drive straight for most of it.
const SHARES: [f64; 5] = [0.075, 0.075, 0.7, 0.075, 0.075];

/// Position and velocity with their covariance, by models of different turn rates.
#[derive(Clone, Copy, Debug)]
pub struct Filter {
    models: [Model; TURNS.len()],
    /// Mean and covariance of all models.
    mean: Estimate,
}

/// A Kalman filter.
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

/// A measured position of an object.
#[derive(Clone, Copy, Debug)]
pub struct Sighting {
    /// The position, m, as if the object stood.
    pub at: Point2<f64>,
    /// Covariance of it, m².
    pub noise: Matrix2<f64>,
    /// The change of `at` by the velocity, s: it is seen at its own time, and lengthened or
    /// shortened by the Doppler shift.
    pub by_velocity: Matrix2<f64>,
}

/// The difference of a measurement to what was predicted.
#[derive(Clone, Copy, Debug)]
pub struct Innovation {
    /// Measured less predicted, m.
    difference: Vector2<f64>,
    /// Covariance of that, m².
    covariance: Matrix2<f64>,
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
    pub fn new(sighting: &Sighting, speed_sigma_mps: f64) -> Self {
        let Sighting {
            at,
            noise,
            by_velocity,
        } = sighting;
        let variance = speed_sigma_mps.powi(2);
        let mut covariance = Matrix4::from_diagonal_element(variance);
        let position = noise + by_velocity * by_velocity.transpose() * variance;
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

    /// Returns the position, m.
    pub fn position(&self) -> Point2<f64> {
        Point2::new(self.mean.state[0], self.mean.state[1])
    }

    /// Returns the velocity, m/s.
    pub fn velocity(&self) -> Vector2<f64> {
        Vector2::new(self.mean.state[2], self.mean.state[3])
    }

    /// Returns the covariance of the position, m².
    pub fn position_covariance(&self) -> Matrix2<f64> {
        self.mean.covariance.fixed_view::<2, 2>(0, 0).into()
    }

    /// Returns the covariance of the velocity, (m/s)².
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

    /// Returns the mean turn rate of the models over their largest, -1 to 1.
    #[cfg(test)]
    pub fn turn(&self) -> f64 {
        let models = self.models.iter().zip(TURNS);
        models.map(|(model, turn)| model.probability * turn).sum()
    }

    /// Predicts the state some seconds later. `heading` is a unit vector, along and across which
    /// the acceleration is uncertain.
    pub fn predict(&mut self, dt_s: f64, heading: &Vector2<f64>, config: &ObjectsConfig) {
        let before = self.models;
        let kept = (-dt_s / config.turn_lasts_s).exp();
        let noise = acceleration_noise(dt_s, heading, config);
        for (index, model) in self.models.iter_mut().enumerate() {
            // A model stays what it is, or any of them begins.
            let from = |other: usize| {
                let stays = if other == index { kept } else { 0.0 };
                before[other].probability * (stays + (1.0 - kept) * SHARES[index])
            };
            model.probability = (0..before.len()).map(from).sum();
            model.estimate = mixture((0..before.len()).map(|o| (from(o), &before[o].estimate)));
            let turn_rate_radps = TURNS[index] * config.turn_rate_radps;
            model.estimate.predict(dt_s, turn_rate_radps, &noise);
        }
        self.combine();
    }

    /// Compares with a measured position.
    pub fn innovation(&self, sighting: &Sighting) -> Innovation {
        self.mean.innovation(sighting)
    }

    /// Updates the state by a measured position.
    pub fn update(&mut self, sighting: &Sighting) {
        let innovations = self.models.map(|model| model.estimate.innovation(sighting));
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

    /// Returns the squared Mahalanobis distance of another state from this one.
    pub fn apart(&self, other: &Self) -> f64 {
        let difference = self.mean.state - other.mean.state;
        let covariance = self.mean.covariance + other.mean.covariance;
        covariance.try_inverse().map_or(f64::INFINITY, |inverse| {
            (difference.transpose() * inverse * difference)[0]
        })
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

    fn innovation(&self, sighting: &Sighting) -> Innovation {
        let mut jacobian = Matrix2x4::zeros();
        jacobian
            .fixed_view_mut::<2, 2>(0, 0)
            .copy_from(&Matrix2::identity());
        jacobian
            .fixed_view_mut::<2, 2>(0, 2)
            .copy_from(&sighting.by_velocity);
        Innovation {
            difference: sighting.at.coords - jacobian * self.state,
            covariance: jacobian * self.covariance * jacobian.transpose() + sighting.noise,
            jacobian,
            noise: sighting.noise,
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

/// Returns mean and covariance of several estimates, each with its weight.
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

/// The covariance of an acceleration that is constant for some seconds.
fn acceleration_noise(dt_s: f64, heading: &Vector2<f64>, config: &ObjectsConfig) -> Matrix4<f64> {
    let [along, across] =
        [config.acceleration_mps2, config.lateral_acceleration_mps2].map(|sigma| sigma * sigma);
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
mod tests {
    use super::*;
    use rand::{Rng, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    const DT_S: f64 = 0.25;
    const SIGMA_M: f64 = 0.4;
    const SPEED_SIGMA_MPS: f64 = 8.0;

    fn sighting(at: Vector2<f64>) -> Sighting {
        Sighting {
            at: at.into(),
            noise: Matrix2::identity() * SIGMA_M.powi(2),
            by_velocity: Matrix2::zeros(),
        }
    }

    /// Two numbers of a normal distribution.
    fn normal(rng: &mut ChaCha8Rng) -> Vector2<f64> {
        Vector2::from_fn(|_, _| (0..12).map(|_| rng.random::<f64>()).sum::<f64>() - 6.0)
    }

    /// A vehicle whose turn rate and accelerations are those of the models.
    struct Vehicle {
        position: Vector2<f64>,
        velocity: Vector2<f64>,
        model: usize,
    }

    impl Vehicle {
        fn step(&mut self, config: &ObjectsConfig, rng: &mut ChaCha8Rng) {
            if rng.random::<f64>() > (-DT_S / config.turn_lasts_s).exp() {
                let mut left = rng.random::<f64>();
                self.model = (0..SHARES.len() - 1)
                    .find(|model| {
                        left -= SHARES[*model];
                        left < 0.0
                    })
                    .unwrap_or(SHARES.len() - 1);
            }
            let heading = self.velocity.normalize();
            let side = Vector2::new(-heading.y, heading.x);
            let pushed = normal(rng);
            let acceleration = heading * (config.acceleration_mps2 * pushed.x)
                + side * (config.lateral_acceleration_mps2 * pushed.y);
            self.turn(TURNS[self.model] * config.turn_rate_radps);
            self.position += acceleration * (0.5 * DT_S * DT_S);
            self.velocity += acceleration * DT_S;
        }

        /// Drives on in steps so small that each is straight.
        fn turn(&mut self, turn_rate_radps: f64) {
            let steps = 1000;
            let dt_s = DT_S / f64::from(steps);
            for _ in 0..steps {
                let turned = nalgebra::Rotation2::new(0.5 * turn_rate_radps * dt_s);
                self.velocity = turned * self.velocity;
                self.position += self.velocity * dt_s;
                self.velocity = turned * self.velocity;
            }
        }
    }

    /// Tracks a vehicle for some scans, and returns the filter.
    fn tracked(
        vehicle: &mut Vehicle,
        (scans, config): (usize, &ObjectsConfig),
        rng: &mut ChaCha8Rng,
        mut step: impl FnMut(&mut Vehicle, &mut ChaCha8Rng),
    ) -> Filter {
        let measured = |vehicle: &Vehicle, rng: &mut ChaCha8Rng| {
            sighting(vehicle.position + normal(rng) * SIGMA_M)
        };
        let mut filter = Filter::new(&measured(vehicle, rng), SPEED_SIGMA_MPS);
        for _ in 1..scans {
            step(vehicle, rng);
            let velocity = filter.velocity();
            let heading = velocity.try_normalize(1e-9).unwrap_or_else(Vector2::x);
            filter.predict(DT_S, &heading, config);
            filter.update(&measured(vehicle, rng));
        }
        filter
    }

    #[test]
    fn the_covariance_is_that_of_the_errors_over_vehicles_that_drive_as_the_models() {
        let mut rng = ChaCha8Rng::seed_from_u64(1);
        let config = ObjectsConfig::default();
        let (mut nees, mut squares_m2, runs) = (0.0, 0.0, 600);
        for _ in 0..runs {
            let velocity = normal(&mut rng) * SPEED_SIGMA_MPS;
            let mut vehicle = Vehicle {
                position: Vector2::new(20.0, -7.0),
                velocity,
                model: 2,
            };
            let filter = tracked(&mut vehicle, (16, &config), &mut rng, |vehicle, rng| {
                vehicle.step(&config, rng);
            });
            let error = filter.velocity() - vehicle.velocity;
            let inverse = filter.velocity_covariance().try_inverse();
            nees += (error.transpose() * inverse.unwrap_or_default() * error)[0] / 2.0;
            squares_m2 += (filter.position().coords - vehicle.position).norm_squared();
        }
        let nees = nees / f64::from(runs);
        assert!((0.75..1.25).contains(&nees), "{nees}");
        // It is better than the measurement.
        let error_m = (squares_m2 / 2.0 / f64::from(runs)).sqrt();
        assert!(error_m < SIGMA_M, "{error_m}");
    }

    #[test]
    fn the_turn_rate_of_a_vehicle_that_goes_on_turning_is_found_and_a_straight_one_has_none() {
        let mut rng = ChaCha8Rng::seed_from_u64(2);
        let config = ObjectsConfig {
            turn_lasts_s: 4.0,
            ..ObjectsConfig::default()
        };
        for wanted_radps in [-0.6, -0.35, 0.0, 0.35, 0.6] {
            let (mut found_radps, mut error_mps, runs) = (0.0, 0.0, 40);
            for _ in 0..runs {
                let mut vehicle = Vehicle {
                    position: Vector2::new(20.0, -7.0),
                    velocity: Vector2::new(-6.0, 5.0),
                    model: 2,
                };
                let filter = tracked(&mut vehicle, (14, &config), &mut rng, |vehicle, _| {
                    vehicle.turn(wanted_radps);
                });
                found_radps += filter.turn() * config.turn_rate_radps / f64::from(runs);
                error_mps += (filter.velocity() - vehicle.velocity).norm() / f64::from(runs);
            }
            assert!(
                (found_radps - wanted_radps).abs() < 0.2,
                "{found_radps} {wanted_radps}"
            );
            assert!(error_mps < 1.2, "{error_mps} at {wanted_radps}");
        }
    }

    #[test]
    fn a_heading_turns_the_velocity_towards_it_and_makes_it_certain_across_it_alone() {
        let mut rng = ChaCha8Rng::seed_from_u64(4);
        let mut vehicle = Vehicle {
            position: Vector2::new(20.0, -7.0),
            velocity: Vector2::new(6.0, 0.0),
            model: 2,
        };
        let config = ObjectsConfig::default();
        let mut filter = tracked(&mut vehicle, (6, &config), &mut rng, |vehicle, _| {
            vehicle.turn(0.0);
        });
        let before = filter;
        let heading = Vector2::new(0.3f64.cos(), 0.3f64.sin());
        let side = Vector2::new(-heading.y, heading.x);
        let variance = |filter: &Filter, of: &Vector2<f64>| {
            (of.transpose() * filter.velocity_covariance() * of)[0]
        };
        filter.align(&heading, 0.1);
        let across_mps = [&before, &filter].map(|filter| filter.velocity().dot(&side).abs());
        assert!(across_mps[1] < 0.2 * across_mps[0], "{across_mps:?}");
        assert!(variance(&filter, &side) <= 0.011);
        assert!(variance(&filter, &heading) > 0.5 * variance(&before, &heading));
        // A heading that may be anything changes nothing.
        let mut same = before;
        same.align(&heading, 1e6);
        assert!((same.velocity() - before.velocity()).norm() < 1e-6);
    }

    #[test]
    fn a_measured_velocity_is_taken_in_its_direction_and_states_are_apart_by_it() {
        let place = sighting(Vector2::new(20.0, -7.0));
        let still = Filter::new(&place, SPEED_SIGMA_MPS);
        let mut moving = still;
        moving.measure(&Vector2::x(), 6.0, 0.1);
        assert!((moving.velocity() - Vector2::new(6.0, 0.0)).norm() < 0.01);
        assert!((moving.velocity_covariance()[(0, 0)] - 0.01).abs() < 1e-4);
        assert_eq!(moving.velocity_covariance()[(1, 1)], 64.0);
        assert_eq!(still.apart(&still), 0.0);
        // 6 m/s with a variance of 64 and 0.01 (m/s)².
        assert!((still.apart(&moving) - 36.0 / 64.01).abs() < 0.01);
    }

    #[test]
    fn a_standing_vehicle_has_no_speed() {
        let mut rng = ChaCha8Rng::seed_from_u64(3);
        let mut vehicle = Vehicle {
            position: Vector2::new(20.0, -7.0),
            velocity: Vector2::zeros(),
            model: 2,
        };
        let filter = tracked(
            &mut vehicle,
            (20, &ObjectsConfig::default()),
            &mut rng,
            |_, _| {},
        );
        let (speed_mps, sigma_mps) = filter.speed();
        assert!(
            speed_mps < 3.0 * sigma_mps && sigma_mps < 1.0,
            "{speed_mps} {sigma_mps}"
        );
    }
}
