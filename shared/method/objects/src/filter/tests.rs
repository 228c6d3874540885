//! The filter of a track on vehicles that drive as its models, and otherwise.

use super::*;
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;

const DT_S: f64 = 0.25;
const SIGMA_M: f64 = 0.4;
const SPEED_SIGMA_MPS: f64 = 8.0;

fn seen(at: Vector2<f64>) -> Detection {
    Detection {
        at: at.into(),
        velocity: Vector2::zeros(),
        heading: Vector2::x(),
        size_m: [4.5, 1.9],
        likely: 0.9,
        sigma_m: SIGMA_M,
        sigma_mps: 1.0,
        by_velocity: Matrix2::zeros(),
    }
}

/// Two numbers of a normal distribution.
fn normal(rng: &mut ChaCha8Rng) -> Vector2<f64> {
    Vector2::from_fn(|_, _| (0..12).map(|_| rng.random::<f64>()).sum::<f64>() - 6.0)
}

/// A vehicle whose turn rate and accelerations match the models.
struct Vehicle {
    position: Vector2<f64>,
    velocity: Vector2<f64>,
    model: usize,
}

impl Vehicle {
    fn new(velocity: Vector2<f64>) -> Self {
        Self {
            position: Vector2::new(20.0, -7.0),
            velocity,
            model: 2,
        }
    }

    fn step(&mut self, rng: &mut ChaCha8Rng) {
        if rng.random::<f64>() > (-DT_S / TURN_LASTS_S).exp() {
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
        let acceleration = heading * (ACCELERATION_MPS2 * pushed.x)
            + side * (LATERAL_ACCELERATION_MPS2 * pushed.y);
        self.turn(TURNS[self.model] * TURN_RATE_RADPS);
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

fn tracked(
    vehicle: &mut Vehicle,
    scans: usize,
    rng: &mut ChaCha8Rng,
    mut step: impl FnMut(&mut Vehicle, &mut ChaCha8Rng),
) -> Filter {
    let measured =
        |vehicle: &Vehicle, rng: &mut ChaCha8Rng| seen(vehicle.position + normal(rng) * SIGMA_M);
    let mut filter = Filter::new(&measured(vehicle, rng), SPEED_SIGMA_MPS);
    for _ in 1..scans {
        step(vehicle, rng);
        let velocity = filter.velocity();
        let heading = velocity.try_normalize(1e-9).unwrap_or_else(Vector2::x);
        filter.predict(DT_S, &heading);
        filter.update(&measured(vehicle, rng));
    }
    filter
}

#[test]
fn the_covariance_is_that_of_the_errors_over_vehicles_that_drive_as_the_models() {
    let mut rng = ChaCha8Rng::seed_from_u64(1);
    let (mut nees, mut squares_m2, runs) = (0.0, 0.0, 600);
    for _ in 0..runs {
        let velocity = normal(&mut rng) * SPEED_SIGMA_MPS;
        let mut vehicle = Vehicle::new(velocity);
        let filter = tracked(&mut vehicle, 16, &mut rng, |vehicle, rng| {
            vehicle.step(rng);
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
fn a_vehicle_that_goes_on_turning_is_found_to_turn_and_a_straight_one_is_not() {
    let mut rng = ChaCha8Rng::seed_from_u64(2);
    for wanted_radps in [-0.6, -0.35, 0.0, 0.35, 0.6] {
        let (mut found_radps, mut error_mps, runs) = (0.0, 0.0, 40);
        for _ in 0..runs {
            let mut vehicle = Vehicle::new(Vector2::new(-6.0, 5.0));
            let filter = tracked(&mut vehicle, 14, &mut rng, |vehicle, _| {
                vehicle.turn(wanted_radps);
            });
            let turns = filter.models.iter().zip(TURNS);
            let turn: f64 = turns.map(|(model, turn)| model.probability * turn).sum();
            found_radps += turn * TURN_RATE_RADPS / f64::from(runs);
            error_mps += (filter.velocity() - vehicle.velocity).norm() / f64::from(runs);
        }
        // A turn lasts half a second in the mean, so that each model expects it to end.
        let share = found_radps / wanted_radps;
        assert!(
            (wanted_radps == 0.0 && found_radps.abs() < 0.1) || (0.2..1.0).contains(&share),
            "{found_radps} {wanted_radps}"
        );
        assert!(error_mps < 1.4, "{error_mps} at {wanted_radps}");
    }
}

#[test]
fn a_heading_turns_the_velocity_towards_it_and_makes_it_certain_across_it_alone() {
    let mut rng = ChaCha8Rng::seed_from_u64(4);
    let mut vehicle = Vehicle::new(Vector2::new(6.0, 0.0));
    let mut filter = tracked(&mut vehicle, 6, &mut rng, |vehicle, _| {
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
    let place = seen(Vector2::new(20.0, -7.0));
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
    let mut vehicle = Vehicle::new(Vector2::zeros());
    let filter = tracked(&mut vehicle, 20, &mut rng, |_, _| {});
    let (speed_mps, sigma_mps) = filter.speed();
    assert!(
        speed_mps < 3.0 * sigma_mps && sigma_mps < 1.0,
        "{speed_mps} {sigma_mps}"
    );
}
