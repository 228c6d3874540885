//! The trajectory-oriented extended Kalman filter of Checchin et al.

use std::collections::BTreeMap;

use gyre_geometry::{Pose, UncertainMotion, covariance::lever};
use nalgebra::{DMatrix, Matrix3, MatrixXx3};

use crate::constraint::{chi_square, group_information};
use crate::relative::{Relative, corrected};
use crate::{CHI_SQUARE_99_9, Constraint, EstimationError, Kind, Outcome, Verdict};

/// A loop that adds less information to its group than this share of its own is redundant.
const MIN_SHARE: f64 = 1e-9;

/// Options of [`TrajectoryFilter`].
#[derive(Debug, Clone, PartialEq)]
pub struct FilterOptions {
    /// The largest number of keyframes. The covariance takes 72 bytes times its square, and a loop costs time in proportion.
    pub max_keyframes: usize,
    /// A loop whose chi-square is larger is rejected.
    pub gate: f64,
    /// The correlation of the errors of any two loops of one group, 0 to 1.
    pub group_correlation: f64,
}

impl Default for FilterOptions {
    /// Returns 2,000 keyframes (a covariance of 288 MB), a gate at 99.9 %, and groups of which each counts as one loop.
    fn default() -> Self {
        Self {
            max_keyframes: 2000,
            gate: CHI_SQUARE_99_9,
            group_correlation: 1.0,
        }
    }
}

/// The extended Kalman filter over the poses of all keyframes.
///
/// The state is the pose of each keyframe, and there is no map (Checchin et al., Sec. 4.1). The first pose is known exactly. A new
/// keyframe costs time in proportion to the number of keyframes, a loop to its square, and no measurement is linearised a second
/// time: use a pose graph for long trajectories and for many loops.
#[derive(Debug, Clone)]
pub struct TrajectoryFilter {
    options: FilterOptions,
    poses: Vec<Pose>,
    /// Of (x, y, yaw) of all poses in their order. Rows and columns beyond the poses are reserve.
    covariance: DMatrix<f64>,
    /// Loops accepted of each group.
    groups: BTreeMap<u64, usize>,
}

impl TrajectoryFilter {
    /// Creates a filter with keyframe 0 at `start`, known exactly.
    pub fn new(start: Pose, options: FilterOptions) -> Self {
        Self {
            options,
            poses: vec![start],
            covariance: DMatrix::zeros(3, 3),
            groups: BTreeMap::new(),
        }
    }

    /// Takes a constraint: an odometry constraint adds a keyframe, a loop is tested and corrects all poses.
    ///
    /// The result depends a little on the order of loops, as each is linearised at the estimate that it finds. A filter cannot take
    /// information back: of a group of dependent loops, each later one adds what it raises the information of the group by.
    ///
    /// # Errors
    /// The constraint does not continue the trajectory, names unknown keyframes or has no usable covariance; or the filter is full.
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

    /// Predicts the pose of keyframe `to` in the frame of `from`, with its covariance (Checchin et al., Eq. 3): the initial guess of
    /// their registration (Eq. 4). `None` if either does not exist.
    pub fn predict(&self, from: usize, to: usize) -> Option<UncertainMotion> {
        let relative = Relative::predict(self.poses.get(from)?, self.poses.get(to)?);
        let (a, b) = (relative.by_from, relative.by_to);
        let cross = a * self.block(from, to) * b.transpose();
        let covariance = a * self.block(from, from) * a.transpose()
            + b * self.block(to, to) * b.transpose()
            + cross
            + cross.transpose();
        Some(UncertainMotion {
            motion: relative.motion,
            covariance,
        })
    }

    /// Returns the poses of all keyframes.
    pub fn poses(&self) -> &[Pose] {
        &self.poses
    }

    /// Returns the pose of a keyframe with its covariance along the axes of the frame of the poses; `None` if it does not exist.
    pub fn pose(&self, keyframe: usize) -> Option<UncertainMotion> {
        Some(UncertainMotion {
            motion: *self.poses.get(keyframe)?,
            covariance: self.block(keyframe, keyframe),
        })
    }

    /// Returns the covariance between (x, y, yaw) of two existing keyframes.
    fn block(&self, row: usize, column: usize) -> Matrix3<f64> {
        self.covariance
            .fixed_view::<3, 3>(3 * row, 3 * column)
            .into_owned()
    }

    /// Adds a keyframe: state augmentation (Checchin et al., Eqs. 1 and 2). Eq. 2 prints the covariance of the whole state beside the
    /// Jacobian with respect to the last pose; the columns of that pose are meant.
    fn augment(&mut self, motion: &UncertainMotion) -> Result<(), EstimationError> {
        let count = self.poses.len();
        self.reserve(count + 1)?;
        let last = UncertainMotion {
            motion: self.poses[count - 1],
            covariance: self.block(count - 1, count - 1),
        };
        let next = last.then(motion);
        let moved = next.motion.translation.vector - last.motion.translation.vector;
        let size = 3 * count;
        let cross = self.columns(count - 1) * lever(moved.x, moved.y).transpose();
        let covariance = &mut self.covariance;
        covariance.view_mut((0, size), (size, 3)).copy_from(&cross);
        covariance
            .view_mut((size, 0), (3, size))
            .tr_copy_from(&cross);
        covariance
            .fixed_view_mut::<3, 3>(size, size)
            .copy_from(&next.covariance);
        self.poses.push(next.motion);
        Ok(())
    }

    /// Makes room for the covariance of `count` keyframes, and for more to come.
    fn reserve(&mut self, count: usize) -> Result<(), EstimationError> {
        let limit = self.options.max_keyframes;
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

    /// Tests a loop against the estimate, and corrects all poses if it agrees.
    fn close(&mut self, constraint: &Constraint, group: Option<u64>) -> Verdict {
        let &Constraint {
            from, to, motion, ..
        } = constraint;
        let relative = Relative::predict(&self.poses[from], &self.poses[to]);
        let innovation = relative.innovation(&motion);
        let by_pose = self.against(from, to, &relative);
        let predicted = Self::project(&by_pose, from, to, &relative);
        let chi_square = chi_square(&innovation, &(predicted + motion.covariance));
        let verdict = |outcome| Verdict {
            chi_square,
            outcome,
        };
        if chi_square.is_nan() || chi_square > self.options.gate {
            return verdict(Outcome::Rejected);
        }
        let share = self.share(group);
        if share < MIN_SHARE {
            return verdict(Outcome::Redundant);
        }
        let noise = motion.covariance / share;
        let Some(inverse) = (predicted + noise).try_inverse() else {
            return verdict(Outcome::Rejected);
        };
        let gain = &by_pose * inverse;
        self.correct(from, to, &relative, &gain, &noise);
        for (keyframe, pose) in self.poses.iter_mut().enumerate() {
            let correction = gain.fixed_rows::<3>(3 * keyframe) * innovation;
            *pose = corrected(pose, &correction);
        }
        verdict(Outcome::Accepted)
    }

    /// Returns what the next loop of a group adds to the information of the group, relative to that of one loop, and counts it.
    fn share(&mut self, group: Option<u64>) -> f64 {
        let Some(group) = group else { return 1.0 };
        let members = self.groups.entry(group).or_default();
        let information = |members| group_information(members, self.options.group_correlation);
        let share = information(*members + 1) - information(*members);
        *members += 1;
        share
    }

    /// Updates the covariance in Joseph's form: (I - K H) P (I - K H)' + K R K', one factor after the other.
    fn correct(
        &mut self,
        from: usize,
        to: usize,
        relative: &Relative,
        gain: &MatrixXx3<f64>,
        noise: &Matrix3<f64>,
    ) {
        let size = 3 * self.poses.len();
        let by_pose = self.against(from, to, relative);
        let mut used = self.covariance.view_mut((0, 0), (size, size));
        used.gemm(-1.0, gain, &by_pose.transpose(), 1.0);
        let rest = gain * noise - self.against(from, to, relative);
        let mut used = self.covariance.view_mut((0, 0), (size, size));
        used.gemm(1.0, &rest, &gain.transpose(), 1.0);
        // Rounding leaves the two triangles apart.
        used.fill_lower_triangle_with_upper_triangle();
    }

    /// Returns the covariance of all poses with the relative pose of two: P H'.
    fn against(&self, from: usize, to: usize, relative: &Relative) -> MatrixXx3<f64> {
        self.columns(from) * relative.by_from.transpose()
            + self.columns(to) * relative.by_to.transpose()
    }

    /// Returns the covariance of the relative pose, H P H', from P H'.
    fn project(
        by_pose: &MatrixXx3<f64>,
        from: usize,
        to: usize,
        relative: &Relative,
    ) -> Matrix3<f64> {
        relative.by_from * by_pose.fixed_rows::<3>(3 * from)
            + relative.by_to * by_pose.fixed_rows::<3>(3 * to)
    }

    /// Returns the covariance of all poses with that of a keyframe.
    fn columns(&self, keyframe: usize) -> MatrixXx3<f64> {
        self.covariance
            .generic_view(
                (0, 3 * keyframe),
                (nalgebra::Dyn(3 * self.poses.len()), nalgebra::Const::<3>),
            )
            .into_owned()
    }
}
