use std::error::Error as StdError;

use gyre_geometry::{OdometryMotion, ScanError, Twist, UncertainMotion};
use gyre_masking::{MaskError, MaskerError};
use thiserror::Error;

use crate::{JointMatch, Refined, SettingError, ShapeError};

#[derive(Clone, Copy, Debug)]
pub struct Registered {
    pub seq: u64,
    /// The pose of this scan's frame in the previous scan's frame, with its covariance. The
    /// identity where the chain starts.
    pub motion: OdometryMotion,
    /// The pose in the frame of the first scan, with its covariance.
    pub pose: UncertainMotion,
    pub outcome: Outcome,
    pub interval_ns: i64,
    pub searched: Option<JointMatch>,
    pub refined: Option<Refined>,
}

impl Registered {
    /// Returns the mean velocity since the previous scan, as searched; `None` where the chain
    /// starts.
    pub fn searched_twist(&self) -> Option<Twist> {
        let interval_s = self.interval_ns as f64 * 1e-9;
        let twist = |found: &JointMatch| Twist::from_motion(&found.motion.pose(), interval_s);
        self.searched.as_ref().map(twist)
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Outcome {
    /// No previous scan: the chain of motions starts here.
    Start,
    Searched,
    /// The refinement against the local map.
    Refined,
    /// A refinement with little support: the covariance is larger, and the scan does not enter the
    /// map.
    Weak,
    /// A prediction from previous motions, since nothing matched.
    Predicted,
}

#[derive(Debug, Error)]
pub enum SetupError {
    #[error(transparent)]
    Masker(#[from] MaskerError),
    #[error(
        "points.capacity is 0, but a refinement of kind `local-map` matches points: it must be 1 or more"
    )]
    NoPoints,
    #[error(transparent)]
    Search(#[from] SettingError),
}

#[derive(Debug, Error)]
pub enum OdometryError {
    #[error(transparent)]
    Mask(#[from] MaskError),
    #[error(transparent)]
    Scan(#[from] ScanError),
    #[error(transparent)]
    Search(#[from] ShapeError),
    #[error(transparent)]
    Own(#[from] Box<dyn StdError + Send + Sync>),
}

impl From<crate::Outcome> for Outcome {
    fn from(outcome: crate::Outcome) -> Self {
        match outcome {
            crate::Outcome::Refined => Self::Refined,
            crate::Outcome::Weak => Self::Weak,
            crate::Outcome::Predicted => Self::Predicted,
        }
    }
}
