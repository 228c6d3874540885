//! The result of a registration, and what can go wrong.

use gyre_geometry::UncertainMotion;
use gyre_masking::{MaskError, MaskerError};
use gyre_radar::ScanError;
use gyre_scan_matching::{ConfigError, JointMatch, Refined, ShapeError};
use thiserror::Error;

/// A registered scan.
#[derive(Clone, Copy, Debug)]
pub struct Registered {
    /// Number of the scan in the chain of motions, from 0.
    pub seq: u64,
    /// The motion from the scan before, with its covariance: this scan's frame in that one's. The identity where the chain
    /// starts.
    pub motion: UncertainMotion,
    /// The pose in the frame of the first scan, with its covariance.
    pub pose: UncertainMotion,
    /// How the motion was found.
    pub outcome: Outcome,
    /// Time between the two scans, ns.
    pub interval_ns: i64,
    /// The result of the search; `None` where the chain starts.
    pub searched: Option<JointMatch>,
    /// The result of the refinement; `None` where there is none.
    pub refined: Option<Refined>,
}

/// How a motion was found.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Outcome {
    /// There is no scan before: the chain of motions starts here.
    Start,
    /// By the search alone: no refinement is configured.
    Searched,
    /// Refined against the local map.
    Refined,
    /// Refined with little support: its covariance is wider, and the scan stays out of the map.
    Weak,
    /// No match: predicted from the motions before.
    Predicted,
}

/// Settings that no odometry can be built from.
#[derive(Debug, Error)]
pub enum SetupError {
    /// The rasters', the points' or the mask's.
    #[error(transparent)]
    Masker(#[from] MaskerError),
    /// The search's or the refinement's.
    #[error(transparent)]
    Search(#[from] ConfigError),
}

/// Why a scan cannot be registered.
#[derive(Debug, Error)]
pub enum OdometryError {
    /// It cannot be rasterised or masked.
    #[error(transparent)]
    Mask(#[from] MaskError),
    /// No points can be extracted from it.
    #[error(transparent)]
    Points(#[from] ScanError),
    /// Its raster cannot be searched.
    #[error(transparent)]
    Search(#[from] ShapeError),
}

impl From<gyre_scan_matching::Outcome> for Outcome {
    fn from(outcome: gyre_scan_matching::Outcome) -> Self {
        match outcome {
            gyre_scan_matching::Outcome::Refined => Self::Refined,
            gyre_scan_matching::Outcome::Weak => Self::Weak,
            gyre_scan_matching::Outcome::Predicted => Self::Predicted,
        }
    }
}
