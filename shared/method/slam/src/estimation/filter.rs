use std::collections::BTreeSet;

use gyre_geometry::{Pose, Twist, UncertainMotion, covariance::lever};
use nalgebra::{DMatrix, Matrix3, MatrixXx3, Vector3};

use crate::estimation::{
    CHI_SQUARE_99_9, Constraint, EstimationError, Kind, Outcome, Verdict,
    constraint::{chi_square, keyframe_exists},
    relative::Relative,
};

/// Linearisations of a loop. After a long drift the second one moves poses by centimetres, the
/// third by less than a millimetre.
const LINEARISATIONS: usize = 3;

/// The extended Kalman filter over the poses of all keyframes, without a map (Checchin et al., Sec.
/// 4.1); the first pose is known exactly. A new keyframe costs time in proportion to the number of
/// keyframes, a loop to its square: use [`PoseGraph`](crate::estimation::PoseGraph) for long
/// trajectories. The paper's filter keeps the covariance of x, y and yaw of each pose, this filter
/// the covariance of a small motion of the world that takes the estimated pose to the true one: to
/// first order the same. An error of yaw moves the poses after it around an arc instead of along
/// its tangent, and the Jacobians of Eqs. 2 and 3 are simpler.
#[derive(Debug, Clone)]
pub struct TrajectoryFilter {
    max_keyframes: usize,
    poses: Vec<Pose>,
    /// Of the errors of all poses in their order: true pose = exp(error) estimate. Rows and columns
    /// beyond the poses are reserve.
    covariance: DMatrix<f64>,
    groups: BTreeSet<u64>,
}

struct Observation {
    ends: [usize; 2],
    predicted: Pose,
    /// Jacobian H of its x, y and yaw with respect to the error of the second pose; for the first
    /// pose it has the opposite sign.
    jacobian: Matrix3<f64>,
}

impl TrajectoryFilter {
    /// The usual number of keyframes, with a covariance of 288 MB: it takes 72 bytes times the
    /// square of the number, and a loop costs time in proportion.
    pub const MAX_KEYFRAMES: usize = 2000;

    /// Creates a filter with keyframe 0 at `start`, known exactly.
    pub fn new(start: Pose, max_keyframes: usize) -> Self {
        Self {
            max_keyframes,
            poses: vec![start],
            covariance: DMatrix::zeros(3, 3),
            groups: BTreeSet::new(),
        }
    }

    /// Takes a constraint: an odometry constraint adds a keyframe, a loop is tested and corrects
    /// all poses. Of a group of dependent loops only the first counts.
    pub fn apply(&mut self, constraint: &Constraint) -> Result<Verdict, EstimationError> {
        constraint.check(self.poses.len())?;
        match constraint.kind {
            Kind::Odometry => self.augment(&constraint.motion).map(|()| Verdict {
                chi_square: 0.0,
                outcome: Outcome::Accepted,
            }),
            Kind::Loop { group } => Ok(self.close(constraint, group)),
        }
    }

    pub fn poses(&self) -> &[Pose] {
        &self.poses
    }

    /// Returns the pose of a keyframe with its covariance along the axes of the frame of the poses.
    pub fn pose(&self, keyframe: usize) -> Result<UncertainMotion, EstimationError> {
        keyframe_exists(keyframe, self.poses.len())?;
        let motion = self.poses[keyframe];
        let to_pose = lever(motion.translation.x, motion.translation.y);
        let block = self
            .covariance
            .fixed_view::<3, 3>(3 * keyframe, 3 * keyframe);
        let covariance = to_pose * block * to_pose.transpose();
        Ok(UncertainMotion {
            motion,
            covariance: 0.5 * (covariance + covariance.transpose()),
        })
    }

    /// Adds a keyframe: state augmentation (Checchin et al., Eqs. 1 and 2). The error of the last
    /// pose moves the new one along with it: the Jacobian of Eq. 2 is the identity.
    fn augment(&mut self, motion: &UncertainMotion) -> Result<(), EstimationError> {
        let count = self.poses.len();
        self.reserve(count + 1)?;
        let last = self.poses[count - 1];
        let next = last * motion.motion;
        let by_motion = lever(-next.translation.x, -next.translation.y)
            * last.rotation.to_rotation_matrix().to_homogeneous();
        let noise = by_motion * motion.covariance * by_motion.transpose();

        let cross = self.columns(count - 1);
        let (size, covariance) = (3 * count, &mut self.covariance);
        let last = cross.fixed_rows::<3>(size - 3);
        covariance
            .fixed_view_mut::<3, 3>(size, size)
            .copy_from(&(last + noise));
        covariance.view_mut((0, size), (size, 3)).copy_from(&cross);
        covariance
            .view_mut((size, 0), (3, size))
            .tr_copy_from(&cross);
        self.poses.push(next);
        Ok(())
    }

    fn reserve(&mut self, count: usize) -> Result<(), EstimationError> {
        let limit = self.max_keyframes;
        if count > limit {
            return Err(EstimationError::TooManyKeyframes { limit });
        }
        if 3 * count > self.covariance.nrows() {
            let room = 3 * (2 * count).min(limit);
            let grown = DMatrix::zeros(room, room);
            let old = std::mem::replace(&mut self.covariance, grown);
            self.covariance
                .view_mut((0, 0), old.shape())
                .copy_from(&old);
        }
        Ok(())
    }

    fn close(&mut self, constraint: &Constraint, group: Option<u64>) -> Verdict {
        let ends = [constraint.from, constraint.to];
        let measured = &constraint.motion;
        let first = self.observe(ends);
        let predicted = first.project(&self.against(&first));
        let innovation = measured.error(&first.predicted);
        let chi_square = chi_square(&innovation, &(predicted + measured.covariance));
        let verdict = |outcome| Verdict {
            chi_square,
            outcome,
        };
        if chi_square.is_nan() || chi_square > CHI_SQUARE_99_9 {
            return verdict(Outcome::Rejected);
        }
        if group.is_some_and(|group| !self.groups.insert(group)) {
            return verdict(Outcome::Redundant);
        }
        match self.correct(first, measured) {
            Some(()) => verdict(Outcome::Accepted),
            None => verdict(Outcome::Rejected),
        }
    }

    /// Corrects all poses by an observation: the iterated update, which linearises the observation
    /// again at the corrected poses. `None` if the covariance of the innovation is singular;
    /// nothing is changed then.
    fn correct(&mut self, first: Observation, measured: &UncertainMotion) -> Option<()> {
        let (ends, noise) = (first.ends, measured.covariance);
        let prior = ends.map(|keyframe| self.poses[keyframe]);
        let mut errors = [Vector3::zeros(); 2];
        let mut observation = first;
        let mut update = None;
        for _ in 0..LINEARISATIONS {
            if update.is_some() {
                let [from, to] = [0, 1].map(|end| exp(&errors[end]) * prior[end]);
                observation = Observation::new(ends, [&from, &to]);
            }
            let against = self.against(&observation);
            let sum = observation.project(&against) + noise;
            let gain = against * sum.cholesky()?.inverse();
            let innovation = measured.error(&observation.predicted)
                + observation.jacobian * (errors[1] - errors[0]);
            errors = ends.map(|keyframe| gain.fixed_rows::<3>(3 * keyframe) * innovation);
            update = Some((gain, innovation));
        }
        let (gain, innovation) = update?;
        self.update_covariance(&observation, &gain, &noise);
        for (keyframe, pose) in self.poses.iter_mut().enumerate() {
            *pose = exp(&(gain.fixed_rows::<3>(3 * keyframe) * innovation)) * *pose;
        }
        Some(())
    }

    fn observe(&self, ends: [usize; 2]) -> Observation {
        Observation::new(ends, ends.map(|keyframe| &self.poses[keyframe]))
    }

    /// Returns P H': the covariance of the errors of all poses with the relative pose.
    fn against(&self, observation: &Observation) -> MatrixXx3<f64> {
        let [from, to] = observation.ends;
        (self.columns(to) - self.columns(from)) * observation.jacobian.transpose()
    }

    /// Updates the covariance in Joseph's form, (I - K H) P (I - K H)' + K R K', one factor after
    /// the other.
    fn update_covariance(
        &mut self,
        observation: &Observation,
        gain: &MatrixXx3<f64>,
        noise: &Matrix3<f64>,
    ) {
        let size = 3 * self.poses.len();
        let left = self.against(observation);
        let mut used = self.covariance.view_mut((0, 0), (size, size));
        used.gemm(-1.0, gain, &left.transpose(), 1.0);
        let right = gain * noise - self.against(observation);
        let mut used = self.covariance.view_mut((0, 0), (size, size));
        used.gemm(1.0, &right, &gain.transpose(), 1.0);
        // Rounding leaves the two triangles apart.
        used.fill_lower_triangle_with_upper_triangle();
    }

    fn columns(&self, keyframe: usize) -> MatrixXx3<f64> {
        let size = nalgebra::Dyn(3 * self.poses.len());
        self.covariance
            .generic_view((0, 3 * keyframe), (size, nalgebra::Const::<3>))
            .into_owned()
    }
}

impl Observation {
    /// Predicts the relative pose of two keyframes, and linearises it (Checchin et al., Eq. 3). A
    /// common error of both poses does not change it.
    fn new(ends: [usize; 2], [from, to]: [&Pose; 2]) -> Self {
        let relative = Relative::predict(from, to);
        Self {
            ends,
            predicted: relative.motion,
            jacobian: relative.by_to * lever(to.translation.x, to.translation.y),
        }
    }

    /// Returns H P H', the covariance of the predicted relative pose, from P H'.
    fn project(&self, against: &MatrixXx3<f64>) -> Matrix3<f64> {
        let [from, to] = self.ends;
        self.jacobian * (against.fixed_rows::<3>(3 * to) - against.fixed_rows::<3>(3 * from))
    }
}

/// Returns the motion of the world with a constant twist of (x, y, yaw) for one unit of time.
fn exp(error: &Vector3<f64>) -> Pose {
    Twist::from([error.x, error.y, error.z]).pose_at(1.0)
}
