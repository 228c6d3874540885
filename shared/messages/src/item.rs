//! What every message starts with.

use bytemuck::{Pod, Zeroable};
use iceoryx2::prelude::ZeroCopySend;

/// Bits of [`Item::flags`].
pub mod flag {
    /// The end of the stream: no scan, and no more to come. Travels in order behind the last scan.
    pub const END: u32 = 1;
    /// The chain of motions starts here: there is no scan before this one to compare with.
    pub const BREAK: u32 = 2;
    /// On `pose`: this is where the trajectory stands now. All have it but those published again after a restart, save the last.
    pub const SYNC: u32 = 4;
    /// On `pose`: the trajectory is still empty, begin with the first scan.
    pub const BASE: u32 = 8;
}

/// The processes that a scan can pass, in order: the index of each one's [`Hop`]. A run has either the two halves of the
/// search or the joint one, and refinement or not; the hops of those it has not stay zero.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
#[repr(usize)]
pub enum Stage {
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
    /// Refines the motion against what was seen before.
    Refinement = 5,
    /// Composes the motions.
    PoseIntegration = 6,
}

impl Stage {
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
    pub fn name(self) -> &'static str {
        let names = [
            "radar-replay",
            "masking",
            "rotation-search",
            "translation-search",
            "joint-search",
            "refinement",
            "pose-integration",
        ];
        names[self as usize]
    }
}

/// When one process had a scan: `CLOCK_MONOTONIC`, ns; zero where it has not been yet.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Pod, Zeroable, ZeroCopySend)]
#[type_name("gyre_hop_v1")]
pub struct Hop {
    /// The last of its inputs was taken from the queue.
    pub received_ns: i64,
    /// Its work began.
    pub started_ns: i64,
    /// Its work was done.
    pub finished_ns: i64,
    /// It was handed to the transport.
    pub published_ns: i64,
}

/// One [`Hop`] a [`Stage`].
pub type Hops = [Hop; Stage::ALL.len()];

/// Which scan a message is about, what it follows, and when each process had it.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Pod, Zeroable, ZeroCopySend)]
#[type_name("gyre_item_v3")]
pub struct Item {
    /// Number in the chain of motions: consecutive, from 0. All rules of the hand-over count in it.
    pub seq: u64,
    /// The scan's place in the recording, or the sensor's own count.
    pub scan: u64,
    /// The scan that this one is compared with (itself where the chain starts).
    pub previous_scan: u64,
    /// Number among the scans that the source published: a gap between consecutive items is what live mode dropped.
    pub published: u64,
    /// The scan's time on the sensor's clock, ns since 1970: the middle of its sweep.
    pub stamp_ns: i64,
    /// When the scan was complete, or would have been on the radar itself: `CLOCK_MONOTONIC`, ns. Latency counts from here.
    pub due_ns: i64,
    /// Process id of the publisher: tells one life of a stage from the next.
    pub pid: u32,
    /// See [`flag`].
    pub flags: u32,
    /// When each process had it.
    pub hops: Hops,
}

impl Item {
    /// Whether all of these flags are set.
    pub fn is(&self, flags: u32) -> bool {
        self.flags & flags == flags
    }

    /// This process's stamps.
    pub fn hop(&mut self, stage: Stage) -> &mut Hop {
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
