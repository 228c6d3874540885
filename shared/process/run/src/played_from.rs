//! The topics that a recording can be played from, and a run be cut at.

use serde::{Deserialize, Serialize};

/// The first topic that is played from a recording: the stages that compute it, and all stages
/// before, are absent.
#[derive(
    Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, schemars::JsonSchema,
)]
#[serde(rename_all = "kebab-case")]
pub enum PlayedFrom {
    /// Scans: all stages compute.
    #[default]
    Scan,
    /// Masked scans.
    Masked,
    /// Rotations, beside masked scans.
    Rotation,
    /// Searched motions, beside masked scans.
    Motion,
    /// Refined motions.
    Refined,
}

impl PlayedFrom {
    /// The name of the topic.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Scan => "scan",
            Self::Masked => "masked",
            Self::Rotation => "rotation",
            Self::Motion => "motion",
            Self::Refined => "refined",
        }
    }

    /// Returns the topics that the stages after it read. `reads_masked`: the last stage reads
    /// masked scans, for the keyframes of SLAM.
    pub fn topics(self, refines: bool, reads_masked: bool) -> Vec<&'static str> {
        match self {
            Self::Scan => vec!["scan"],
            Self::Masked => vec!["masked"],
            Self::Rotation => vec!["masked", "rotation"],
            Self::Motion if refines || reads_masked => vec!["masked", "motion"],
            Self::Motion => vec!["motion"],
            Self::Refined if reads_masked => vec!["masked", "refined"],
            Self::Refined => vec!["refined"],
        }
    }
}
