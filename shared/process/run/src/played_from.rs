//! The topics that a recording can be played from, and a run be cut at.

use serde::{Deserialize, Serialize};

gyre_messages::named! {
    /// The first topic that is played from a recording: the stages that compute it, and all stages
    /// before, are absent.
    #[derive(
        Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, schemars::JsonSchema,
    )]
    #[serde(rename_all = "kebab-case")]
    pub enum PlayedFrom {
        /// Scans: all stages compute.
        #[default]
        Scan = "scan",
        /// Masked scans.
        Masked = "masked",
        /// Rotations, beside masked scans.
        Rotation = "rotation",
        /// Searched motions, beside masked scans.
        Motion = "motion",
        /// Refined motions.
        Refined = "refined",
    }
}

impl PlayedFrom {
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
