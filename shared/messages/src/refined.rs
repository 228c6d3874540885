//! `refined`: the motion between two scans after refinement.

use bytemuck::{Pod, Zeroable};
use gyre_scan_matching::{InitialGuess, Outcome};
use iceoryx2::prelude::ZeroCopySend;

use crate::{FloatBlock, Message, MotionHeader, topic::History};

/// As [`Motion`](crate::Motion), in runs that refine. The motion as searched stays in it beside the refined one.
#[derive(Debug)]
pub enum Refined {}

impl Message for Refined {
    const TOPIC: &'static str = "refined";
    const READERS: usize = 1;
    const HISTORY: History = History::Feedback;
    type Header = MotionHeader;
    type Element = FloatBlock;
}

/// Values of [`RefinementRecord::outcome`].
pub mod outcome {
    /// The motion is the search's: the run does not refine, or the chain starts here.
    pub const SEARCHED: u32 = 0;
    /// Refined.
    pub const REFINED: u32 = 1;
    /// Refined with little support: the motion is kept, its scan stays out of the map.
    pub const WEAK: u32 = 2;
    /// No match: the motion is predicted from those before.
    pub const PREDICTED: u32 = 3;
}

/// Values of [`RefinementRecord::initial_guess`].
pub mod initial_guess {
    /// There was no refinement.
    pub const NONE: u32 = 0;
    /// The motion predicted at constant velocity.
    pub const PREDICTION: u32 = 1;
    /// The search's motion.
    pub const SEARCH: u32 = 2;
    /// The prediction with a yaw offset, tried when nothing else matched.
    pub const YAW_OFFSET: u32 = 3;
}

/// How the refinement changed a motion; all zero where there was none.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable, ZeroCopySend)]
#[type_name("gyre_refinement_v1")]
pub struct RefinementRecord {
    /// How it ended: see [`outcome`].
    pub outcome: u32,
    /// What the accepted motion was refined from: see [`initial_guess`].
    pub initial_guess: u32,
    /// Mean of the map under the scan's points, 0 to 1; 1 where all keyframes saw something wherever the scan did.
    pub overlap: f64,
    /// Weight of the scan's points over its running mean.
    pub support: f64,
}

impl From<&gyre_scan_matching::Refined> for RefinementRecord {
    fn from(refined: &gyre_scan_matching::Refined) -> Self {
        Self {
            outcome: match refined.outcome {
                Outcome::Refined => outcome::REFINED,
                Outcome::Weak => outcome::WEAK,
                Outcome::Predicted => outcome::PREDICTED,
            },
            initial_guess: match refined.guess {
                InitialGuess::Prediction => initial_guess::PREDICTION,
                InitialGuess::Search => initial_guess::SEARCH,
                InitialGuess::YawOffset => initial_guess::YAW_OFFSET,
            },
            overlap: refined.overlap,
            support: refined.support,
        }
    }
}
