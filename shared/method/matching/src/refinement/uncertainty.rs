//! Covariances of refined and predicted motions, and the shares of them that accumulate.

use gyre_geometry::Pose;
use nalgebra::{Matrix3, Vector2, Vector3};

use super::{
    Outcome, RefinementConfig, TrackerState,
    alignment::Alignment,
    candidates::Scan,
    config::{JITTER_DEG, JITTER_M},
    filter::grown,
    local_map::LocalMap,
    points::DeskewedPoints,
    standstill::Report,
    tracker::Step,
};

pub(super) const WEAK_FACTOR: f64 = 4.0;
/// Drift share of a prediction, whose error the next match takes back, and of that match. Not zero,
/// since edges of a pose graph need a covariance that has an inverse.
const MIN_DRIFT_SHARE: f64 = 1e-3;

/// The uncertainty of a motion due to the time before its scan: the map, and the predictions since
/// the last match.
pub(super) struct Uncertainty {
    /// The covariance of a prediction over the scan's interval, behind a match.
    of_step: Matrix3<f64>,
    /// The same behind the predictions in a row before it.
    pub of_prediction: Matrix3<f64>,
    predictions: u32,
    of_predictions: Matrix3<f64>,
    /// The share of a match's covariance that makes the map drift.
    of_map: f64,
}

impl Uncertainty {
    pub fn before(
        scan: &Scan<'_>,
        map: &LocalMap,
        state: &TrackerState,
        predictions: u32,
        config: &RefinementConfig,
    ) -> Self {
        let of_prediction = |grown: f64| of_prediction(state, &scan.step, grown, config);
        let [before, together] = [state.unmatched, predictions].map(f64::from);
        // As long as a match can take them back, the last pose has the error of all.
        let growth = match before == together {
            true => (together + 1.0).powi(2),
            false => grown(1.0, before),
        };
        let of_predictions = match state.has_distance() && predictions > 0 {
            true => state.since_match.covariance,
            false => of_prediction(together) * together,
        };
        Self {
            of_step: of_prediction(1.0),
            of_prediction: of_prediction(growth),
            predictions,
            of_predictions,
            of_map: drift_share(map.len(), config),
        }
    }

    /// Returns the variance of the prediction in an otherwise undetermined direction, such that the
    /// variances of consecutive scans add up; `before` of them are at constant velocity, whose
    /// error is common to all.
    pub fn of_predicted_place(&self, along: Vector2<f64>, before: u32) -> f64 {
        let place = self.of_step.fixed_view::<2, 2>(0, 0);
        let variance = (along.transpose() * place * along)[0];
        variance * grown(1.0, f64::from(before))
    }

    /// Returns the covariance of a reported motion. One that takes back the error of predictions
    /// has theirs too.
    pub fn of_report(&self, report: &Report) -> Matrix3<f64> {
        let covariance = report.motion.covariance;
        match report.stationary {
            true => covariance,
            false => covariance + self.of_predictions,
        }
    }

    /// Returns the share of the covariance that accumulates. `map` is the one after the scan: with
    /// one that was given up nothing is taken back.
    pub fn drift_share(&self, outcome: Outcome, map: &LocalMap) -> f64 {
        if map.is_empty() {
            1.0
        } else if outcome == Outcome::Predicted || self.predictions > 0 {
            MIN_DRIFT_SHARE
        } else {
            self.of_map
        }
    }
}

/// A covariance with another variance in a direction of unit length, whose error is independent of
/// the others: those are as if the place in that direction were known.
pub(super) fn with_variance(
    covariance: &Matrix3<f64>,
    along: Vector3<f64>,
    variance: f64,
) -> Matrix3<f64> {
    let of_along = covariance * along;
    let known = covariance - of_along * of_along.transpose() / along.dot(&of_along);
    known + along * along.transpose() * variance
}

/// The covariance of the motion from `previous` to an alignment, from the information matrix;
/// `None` if the points do not determine the pose.
pub(super) fn of_alignment(
    alignment: &Alignment,
    points: &DeskewedPoints,
    previous: &Pose,
    config: &RefinementConfig,
) -> Option<Matrix3<f64>> {
    let inverse = alignment.normal.information.try_inverse()?;
    let mean_squared_residual = alignment.normal.cost / points.total_weight();
    // From the map's axes to the axes of the previous scan.
    let turn = previous
        .rotation
        .inverse()
        .to_rotation_matrix()
        .to_homogeneous();
    // The mean weight cancels a factor that all weights share, as under a mask.
    let scale = config.variance_scale * points.mean_weight() * mean_squared_residual;
    let shape = turn * inverse * turn.transpose() * scale;
    let yaw = config.yaw_sigma_deg.to_radians().powi(2);
    let covariance = shape + Matrix3::from_diagonal(&Vector3::new(0.0, 0.0, yaw));
    // A few points along a line leave an inverse that rounding makes no covariance.
    let is_one = covariance.iter().all(|v| v.is_finite()) && covariance.cholesky().is_some();
    is_one.then_some(covariance)
}

/// The covariance of an alignment by errors of the azimuths of some rows beside each other, whose
/// mean over the turn has this variance. The mean turns the scan; and since all of the error is in
/// one direction, the scan also moves across that by the mean times the typical range. The
/// direction is any, so each axis has half of it.
pub(super) fn by_azimuths(alignment: &Alignment, variance_rad2: f64) -> Matrix3<f64> {
    let information = &alignment.normal.information;
    let square_range_m2 = 2.0 * information[(2, 2)] / (information[(0, 0)] + information[(1, 1)]);
    let sideways = 0.5 * square_range_m2 * variance_rad2;
    Matrix3::from_diagonal(&Vector3::new(sideways, sideways, variance_rad2))
}

/// The share of a match's covariance that makes a map of `keyframes` drift.
///
/// A scan becomes one of the map's k keyframes with the noise of its registration, and the map's
/// mean follows. A mean of k values that keeps up with itself in this way is a random walk, whose
/// steps are 2 / (k + 1) of the noise. Places that a vehicle has passed drop out of the mean
/// earlier, and errors of neighbouring scans are correlated: hence the factor. A slow vehicle, not
/// all of whose scans become keyframes, drifts less in simulation, but not on real drives.
pub(super) fn drift_share(keyframes: usize, config: &RefinementConfig) -> f64 {
    let step = config.drift_scale * 2.0 / (keyframes as f64 + 1.0);
    step.powi(2).min(1.0)
}

/// The covariance of a motion predicted at constant velocity, whose acceleration is within the
/// limits; of its turn, by the gyro if there is one; of its distance, by wheels or Doppler. An
/// error of the velocity is common to all predictions in a row: its part is `grown`.
fn of_prediction(
    state: &TrackerState,
    step: &Step,
    grown: f64,
    config: &RefinementConfig,
) -> Matrix3<f64> {
    let interval_s = step.interval_s;
    let variance = |jitter: f64, acceleration: f64| {
        grown * (jitter + acceleration * interval_s.powi(2)).powi(2) / 3.0
    };
    let shift = variance(JITTER_M, config.acceleration_mps2);
    let turn = variance(
        JITTER_DEG.to_radians(),
        config.yaw_acceleration_degps2.to_radians(),
    );
    if let Some(distance) = &step.distance {
        let by_gyro = step
            .turn
            .map(|it| it.variance_after_rad2(&state.since_match));
        let yaw_rad = state.predicted_turn_rad(step);
        return distance
            .motion([yaw_rad, by_gyro.map_or(turn, |it| it.min(turn))])
            .covariance;
    }
    let turn = step.turn.map_or(turn, |it| it.variance_rad2().min(turn));
    Matrix3::from_diagonal(&Vector3::new(shift, shift, turn))
}

#[cfg(test)]
mod tests {
    use std::f64::consts::TAU;

    use super::*;
    use crate::refinement::normal_equations::NormalEquations;

    #[test]
    fn a_map_of_one_keyframe_drifts_by_the_whole_noise_and_one_of_many_by_little_of_it() {
        let config = RefinementConfig {
            drift_scale: 1.0,
            ..RefinementConfig::default()
        };
        let share = |keyframes| drift_share(keyframes, &config);
        assert_eq!(share(1), 1.0);
        assert_eq!(share(3), 0.25);
        assert!((share(10) - 4.0 / 121.0).abs() < 1e-12);
    }

    /// Points all around with gradients of any direction; the points of one sector are turned by an
    /// angle, and the pose is fitted. Over sectors in all directions this is the covariance that is
    /// stated for the variance of the mean angle.
    #[test]
    fn azimuths_that_err_in_a_sector_move_the_scan_as_stated() {
        const POINTS: usize = 20_000;
        const SECTORS: usize = 50;
        const WIDTH: usize = POINTS / SECTORS;
        const TURN_RAD: f64 = 0.01;
        let golden = |k: usize, step: f64| (k as f64 * step).fract();
        let gradients: Vec<Vector3<f64>> = (0..POINTS)
            .map(|k| {
                let (sin, cos) = (k as f64 / POINTS as f64 * TAU).sin_cos();
                let range_m = 5.0 + 60.0 * golden(k, 0.754_877_666);
                let (ny, nx) = (golden(k, 0.569_840_291) * TAU).sin_cos();
                Vector3::new(nx, ny, range_m * (cos * ny - sin * nx))
            })
            .collect();
        let information: Matrix3<f64> = gradients.iter().map(|j| j * j.transpose()).sum();
        let alignment = Alignment {
            pose: Pose::identity(),
            normal: NormalEquations {
                cost: 0.0,
                overlap: 0.0,
                right_hand_side: Vector3::zeros(),
                information,
            },
        };
        let inverse = information.try_inverse().unwrap();
        let of_sectors: Matrix3<f64> = (0..SECTORS)
            .map(|sector| {
                let first = sector * POINTS / SECTORS;
                let sector = &gradients[first..first + WIDTH];
                let moved: Vector3<f64> = sector.iter().map(|j| j * j.z * TURN_RAD).sum();
                inverse * moved * (inverse * moved).transpose() / SECTORS as f64
            })
            .sum();
        let mean_rad = TURN_RAD * WIDTH as f64 / POINTS as f64;
        let stated = by_azimuths(&alignment, mean_rad.powi(2));
        for axis in 0..3 {
            let ratio = of_sectors[(axis, axis)] / stated[(axis, axis)];
            assert!((0.8..1.25).contains(&ratio), "axis {axis}: {ratio}");
        }
    }
}
