//! `refined`: the motion between two scans once more, refined.

use bytemuck::{Pod, Zeroable};
use iceoryx2::prelude::ZeroCopySend;

use crate::{FloatBlock, MotionHeader, topic::message};

message! {
    /// As [`Motion`](crate::Motion), in runs that refine. What the search found stays in it beside the refined motion.
    Refined, "refined", MotionHeader, FloatBlock
}

/// Values of [`Refinement::outcome`].
pub mod outcome {
    /// The motion is the search's: nobody refined it.
    pub const SEARCHED: u32 = 0;
    /// Refined.
    pub const REFINED: u32 = 1;
    /// Refined with little to go by: the motion is kept, its scan stays out of the map.
    pub const WEAK: u32 = 2;
    /// Nothing fitted: the motion before goes on.
    pub const PREDICTED: u32 = 3;
}

/// Values of [`Refinement::hypothesis`].
pub mod hypothesis {
    /// There was no refinement.
    pub const NONE: u32 = 0;
    /// The motion before.
    pub const PREDICTION: u32 = 1;
    /// The search's motion.
    pub const SEARCH: u32 = 2;
    /// The motion before, turned to one side: tried when nothing else fitted.
    pub const FAN: u32 = 3;
}

/// What the refinement made of a motion; all zero where there was none.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable, ZeroCopySend)]
#[type_name("gyre_refinement_v1")]
pub struct Refinement {
    /// How it ended: see [`outcome`].
    pub outcome: u32,
    /// What the accepted motion was refined from: see [`hypothesis`].
    pub hypothesis: u32,
    /// Mean of the map under the scan's points, 0 to 1; 1 where all keyframes saw something wherever the scan did.
    pub overlap: f64,
    /// Weight of the scan's points, as a share of what is usual.
    pub support: f64,
}
