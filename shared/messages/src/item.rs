//! The start of every message: which scan it is about, and when each process worked on it.

use bytemuck::{Pod, Zeroable};
use iceoryx2::prelude::ZeroCopySend;

/// Bits of [`Item::flags`].
pub mod flag {
    /// The end of the stream: no scan, and no more to come. Travels in order behind the last scan.
    pub const END: u32 = 1;
    /// The chain of motions starts here: there is no scan before this one to compare with.
    pub const BREAK: u32 = 2;
    /// On `pose`: the newest pose of the trajectory. After a restart the last poses are published again, and only the
    /// last of them has this flag.
    pub const SYNC: u32 = 4;
    /// On `pose`: the trajectory is empty, and the stream begins with the first scan.
    pub const BASE: u32 = 8;
}

/// The processes that a scan can pass, in the order of the stream: the index of each one's [`Hop`]. A run has either the
/// two halves of the search or the joint one, and refinement or not; the hops of those that it lacks stay zero.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
#[repr(usize)]
pub enum StageId {
    /// Reads the sensor or a recording.
    RadarReplay = 0,
    /// Rasterises and masks.
    Masking = 1,
    /// Finds the rotation.
    RotationSearch = 2,
    /// Finds the translation.
    TranslationSearch = 3,
    /// Finds both together.
    JointSearch = 4,
    /// Refines the motion against the local map.
    Refinement = 5,
    /// Composes the motions.
    PoseIntegration = 6,
}

impl StageId {
    /// All of them, in the order of the stream.
    pub const ALL: [Self; 7] = [
        Self::RadarReplay,
        Self::Masking,
        Self::RotationSearch,
        Self::TranslationSearch,
        Self::JointSearch,
        Self::Refinement,
        Self::PoseIntegration,
    ];

    /// The name used in configurations, on the command line and in results.
    pub const fn name(self) -> &'static str {
        match self {
            Self::RadarReplay => "radar-replay",
            Self::Masking => "masking",
            Self::RotationSearch => "rotation-search",
            Self::TranslationSearch => "translation-search",
            Self::JointSearch => "joint-search",
            Self::Refinement => "refinement",
            Self::PoseIntegration => "pose-integration",
        }
    }

    /// The stage of this name.
    pub fn by_name(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|stage| stage.name() == name)
    }
}

/// When one process worked on a scan: `CLOCK_MONOTONIC`, ns; zero before.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Pod, Zeroable, ZeroCopySend)]
#[type_name("gyre_hop_v1")]
pub struct Hop {
    /// The last of its inputs was taken from the queue.
    pub received_ns: i64,
    /// `process` began.
    pub started_ns: i64,
    /// `process` ended.
    pub finished_ns: i64,
    /// The output was handed to the transport.
    pub published_ns: i64,
}

/// One [`Hop`] for each [`StageId`].
pub type Hops = [Hop; StageId::ALL.len()];

/// Which scan a message is about, which scan it follows, and when each process worked on it.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Pod, Zeroable, ZeroCopySend)]
#[type_name("gyre_item_v3")]
pub struct Item {
    /// Number in the chain of motions: consecutive, from 0. The hand-over protocol counts in it.
    pub seq: u64,
    /// The scan's place in the recording, or the sensor's own count.
    pub scan: u64,
    /// The scan that this one is matched against (itself where the chain starts).
    pub previous_scan: u64,
    /// Number among the scans that the source published: a gap between consecutive items counts the scans dropped in
    /// live mode.
    pub published: u64,
    /// The scan's time on the sensor's clock, ns since 1970: the middle of its sweep.
    pub stamp_ns: i64,
    /// When the sweep was complete, or would have been on the radar itself: `CLOCK_MONOTONIC`, ns. Latency counts from
    /// here.
    pub due_ns: i64,
    /// Process id of the publisher; it changes when a stage is restarted.
    pub pid: u32,
    /// See [`flag`].
    pub flags: u32,
    /// When each process worked on it.
    pub hops: Hops,
}

impl Item {
    /// Whether all of these flags are set.
    pub fn is(&self, flags: u32) -> bool {
        self.flags & flags == flags
    }

    /// This process's stamps.
    pub fn hop(&mut self, stage: StageId) -> &mut Hop {
        &mut self.hops[stage as usize]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sizes_are_part_of_the_wire_format() {
        assert_eq!(size_of::<Hop>(), 32);
        assert_eq!(size_of::<Item>(), 56 + 7 * 32);
    }
}
