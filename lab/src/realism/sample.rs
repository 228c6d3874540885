//! The measures of a recording.

use gyre_geometry::Pose;
use gyre_radar::OwnedScan;

/// A scan to be measured.
pub struct Sample {
    /// The scan on the common grid.
    pub scan: OwnedScan,
    /// The pose in the frame of the sample before it, if that is the scan before it in the
    /// recording and the motion is known.
    pub motion: Option<Pose>,
}
