//! The pose between scans: from the last pose by gyro, wheels and the last velocity.

use nalgebra::Matrix3;

use crate::{
    Twist, UncertainMotion,
    samples::{
        Sample, SampleKind, SensorConfig, SensorConfigs, Witness,
        integral::{Integral, rates, seconds},
    },
};

/// Acceleration along the path, m/s², and of the yaw, rad/s²: RMS of the changes in 0.25 to 1 s of
/// the velocities of motions over 0.25 s. Two drives of RADIATE and six simulated roads have 0.6 to
/// 1.0 and 0.06 to 0.17: the largest.
const ACCELERATION_MPS2: f64 = 1.0;
const YAW_ACCELERATION_RADPS2: f64 = 0.17;
/// The longest prediction, ns: a scan that is so late is missing.
const MAX_AHEAD_NS: i64 = 2_000_000_000;

/// The last pose, with the motion to it.
#[derive(Clone, Copy, Debug)]
pub struct PredictionStart {
    pub stamp_ns: i64,
    pub pose: UncertainMotion,
    /// The mean velocity of the motion over `interval_s`, and the covariance of that motion.
    pub twist: Twist,
    pub interval_s: f64,
    pub covariance: Matrix3<f64>,
    /// The learnt errors of gyro and wheels; `None` of a sensor that is not used.
    pub gyro: Option<LearntErrors>,
    pub wheels: Option<LearntErrors>,
}

/// The errors that all measurements of a sensor share.
#[derive(Clone, Copy, Debug, Default)]
pub struct LearntErrors {
    /// True over measured.
    pub scale: f64,
    pub scale_sigma: f64,
    /// Per second.
    pub bias: f64,
    pub bias_sigma: f64,
}

/// A change since the last pose, and its variance.
type Change = (f64, f64);

impl PredictionStart {
    /// Predicts the pose at a time from the samples, on the radar's clock and in their order. Which
    /// samples have a stamp up to that time alone decides. `None`: the motion to the last pose is
    /// not known, or the time is not within two seconds after it.
    pub fn predict(
        &self,
        configs: &SensorConfigs,
        samples: &[Sample],
        at_ns: i64,
    ) -> Option<UncertainMotion> {
        let ahead_ns = at_ns.checked_sub(self.stamp_ns)?;
        if !(1..=MAX_AHEAD_NS).contains(&ahead_ns) || self.interval_s <= 0.0 {
            return None;
        }
        let time_s = seconds(ahead_ns);
        let end = samples.partition_point(|sample| sample.stamp_ns <= at_ns);
        let span_ns = [self.stamp_ns, at_ns];
        let by = |kind: Witness, errors: Option<LearntErrors>, acceleration| {
            let of = kind.row().samples?;
            let (config, errors) = (configs.of(kind)?, errors?);
            measured(config, of, &samples[..end], span_ns, &errors, acceleration)
        };
        let moved = |rate: f64, variance: f64, acceleration: f64| {
            let since_middle_s = 0.5 * (time_s + self.interval_s);
            let by_rate = variance * (time_s / self.interval_s).powi(2);
            let by_acceleration = (acceleration * time_s * since_middle_s).powi(2);
            (rate * time_s, by_rate + by_acceleration)
        };
        let turn = by(Witness::Gyro, self.gyro, YAW_ACCELERATION_RADPS2);
        let ahead = by(Witness::Wheels, self.wheels, ACCELERATION_MPS2);
        let (velocity, variance) = (&self.twist, |k| self.covariance[(k, k)]);
        let (yaw_rad, of_yaw) = turn.unwrap_or_else(|| {
            moved(
                velocity.yaw_rate_radps,
                variance(2),
                YAW_ACCELERATION_RADPS2,
            )
        });
        let (ahead_m, of_ahead) =
            ahead.unwrap_or_else(|| moved(velocity.vx_mps, variance(0), ACCELERATION_MPS2));
        let (left_m, of_left) = moved(velocity.vy_mps, variance(1), 0.0);
        let mean = Twist::from([ahead_m, left_m, yaw_rad].map(|change| change / time_s));
        // An error of the turn moves the end of the arc across the path by half of it.
        let across = 0.5 * ahead_m;
        let mut covariance = Matrix3::zeros();
        covariance[(0, 0)] = of_ahead;
        covariance[(1, 1)] = of_left + across.powi(2) * of_yaw;
        covariance[(2, 2)] = of_yaw;
        (covariance[(1, 2)], covariance[(2, 1)]) = (across * of_yaw, across * of_yaw);
        Some(self.pose.then(&UncertainMotion {
            motion: mean.chord_pose_at(time_s),
            covariance,
        }))
    }
}

/// Integrates the samples of a sensor. After the last sample its rate holds.
fn measured(
    config: &dyn SensorConfig,
    of: SampleKind,
    samples: &[Sample],
    span_ns: [i64; 2],
    errors: &LearntErrors,
    acceleration: f64,
) -> Option<Change> {
    let rates: Vec<_> = rates(samples, of).collect();
    let max_gap_ns = (config.max_gap_s() * 1e9) as i64;
    let integral = Integral::of(&rates, span_ns, max_gap_ns)?;
    let (sum, time_s) = (integral.sum, integral.interval_s);
    let held_s = seconds(span_ns[1] - rates.last()?.0);
    let variance = config.variance_of(&integral)
        + (errors.bias_sigma * time_s).powi(2)
        + (errors.scale_sigma * sum).powi(2)
        + (0.5 * acceleration * held_s.powi(2)).powi(2);
    Some((errors.scale * sum - errors.bias * time_s, variance))
}

#[cfg(test)]
mod tests {
    use nalgebra::Vector3;

    use super::*;
    use crate::pose;

    const MS: i64 = 1_000_000;
    const TRUE: LearntErrors = LearntErrors {
        scale: 1.0,
        scale_sigma: 0.0,
        bias: 0.0,
        bias_sigma: 0.0,
    };

    /// At 10 m/s on a straight, with a small deviation.
    fn start() -> PredictionStart {
        PredictionStart {
            stamp_ns: 0,
            pose: UncertainMotion {
                motion: pose(100.0, 0.0, 0.0),
                covariance: Matrix3::from_diagonal(&Vector3::new(0.01, 0.01, 1e-6)),
            },
            twist: [10.0, 0.0, 0.0].into(),
            interval_s: 0.25,
            covariance: Matrix3::from_diagonal(&Vector3::new(4e-4, 4e-4, 4e-6)),
            gyro: None,
            wheels: None,
        }
    }

    /// A turn that begins at the pose: 0.4 rad/s, while the vehicle brakes by 4 m/s².
    fn samples(until_ms: i64) -> Vec<Sample> {
        let at = |ms: i64| {
            let speed_mps = 10.0 - 4e-3 * ms as f64;
            [
                Sample::yaw_rate(ms * MS, 0.4),
                Sample::speed(ms * MS, speed_mps),
            ]
        };
        (0..=until_ms).step_by(10).flat_map(at).collect()
    }

    #[test]
    fn without_sensors_the_velocity_holds_and_the_deviation_grows() {
        let predicted = |ms| {
            let predicted = start().predict(&SensorConfigs::default(), &[], ms * MS);
            predicted.unwrap()
        };
        let [near, far] = [predicted(125), predicted(250)];
        let end = far.error(&pose(102.5, 0.0, 0.0));
        assert!(end.norm() < 1e-9, "{end}");
        assert!(near.covariance[(0, 0)] > 0.01 && far.covariance[(0, 0)] > near.covariance[(0, 0)]);
        assert!(far.covariance[(0, 0)].sqrt() < 0.2);
    }

    #[test]
    fn gyro_and_wheels_measure_a_turn_and_braking_up_to_the_time() {
        let configs = SensorConfigs::default();
        let with = PredictionStart {
            gyro: Some(TRUE),
            wheels: Some(TRUE),
            ..start()
        };
        let expected = Twist::from([9.5, 0.0, 0.4]).pose_at(0.25);
        let at = |samples: &[Sample]| with.predict(&configs, samples, 250 * MS).unwrap();
        let all = at(&samples(250));
        let apart = all.error(&(pose(100.0, 0.0, 0.0) * expected));
        assert!(apart.norm() < 0.01, "{apart}");
        // A later sample changes nothing, and missing ones leave the last velocity.
        assert_eq!(at(&samples(400)), all);
        let alone = start().predict(&configs, &[], 250 * MS).unwrap();
        assert_eq!(with.predict(&configs, &[], 250 * MS).unwrap(), alone);
        assert!(all.covariance.trace() < alone.covariance.trace());
    }

    #[test]
    fn nothing_is_predicted_without_a_motion_nor_far_ahead_nor_backwards() {
        let configs = SensorConfigs::default();
        let unknown = PredictionStart {
            interval_s: 0.0,
            ..start()
        };
        assert!(unknown.predict(&configs, &[], 100 * MS).is_none());
        for ms in [-10, 0, 2001] {
            assert!(start().predict(&configs, &[], ms * MS).is_none(), "{ms}");
        }
    }
}
