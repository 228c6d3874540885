//! Registered scans.

use gyre_geometry::{UncertainMotion, pose};
use gyre_matching::odometry::Outcome;
use pyo3::prelude::*;

use crate::pose::Pose;

/// A registered scan: what `Odometry.register` returns.
#[pyclass(module = "gyre", frozen)]
pub struct Registered {
    pub registered: gyre_matching::odometry::Registered,
    /// The time of the scan, ns.
    #[pyo3(get)]
    pub stamp_ns: i64,
}

#[pymethods]
impl Registered {
    /// The number of the scan among those that were registered, from 0.
    #[getter]
    fn seq(&self) -> u64 {
        self.registered.seq
    }

    /// The origin of the motion: `start` (none: the chain starts here), `searched`, `refined`,
    /// `weak` (refined with little support) or `predicted` (nothing matched).
    #[getter]
    fn outcome(&self) -> &'static str {
        match self.registered.outcome {
            Outcome::Start => "start",
            Outcome::Searched => "searched",
            Outcome::Refined => "refined",
            Outcome::Weak => "weak",
            Outcome::Predicted => "predicted",
        }
    }

    /// The motion since the previous scan, in that scan's frame; the identity at `start`.
    #[getter]
    fn motion(&self) -> Pose {
        Pose(self.registered.motion.alone())
    }

    /// The pose in the frame of the first scan.
    #[getter]
    fn pose(&self) -> Pose {
        Pose(self.registered.pose)
    }

    /// The motion as searched, before it was refined; None at `start`.
    #[getter]
    fn searched(&self) -> Option<Pose> {
        let found = self.registered.searched.as_ref()?.motion;
        Some(Pose(UncertainMotion {
            motion: pose(found.x_m, found.y_m, found.yaw_rad),
            covariance: found.covariance,
        }))
    }

    /// The time since the previous scan, ns; 0 at `start`.
    #[getter]
    fn interval_ns(&self) -> i64 {
        self.registered.interval_ns
    }

    /// Returns whether the vehicle stands. While it does, motions are zero.
    #[getter]
    fn stationary(&self) -> bool {
        let refined = self.registered.refined.as_ref();
        refined.is_some_and(|refined| refined.stationary)
    }

    fn __repr__(&self) -> String {
        let (seq, outcome, motion) = (self.seq(), self.outcome(), self.motion());
        format!("<gyre.Registered {seq}, {outcome}, motion={motion}>")
    }
}
