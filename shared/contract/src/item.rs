//! The start of every message: the scan that it is about, and the time stamps of each stage.

use gyre_geometry::{LostAzimuths, MAX_AZIMUTHS, MAX_GAPS};

use crate::{
    limits::{Limits, Window},
    wire::{Bounds, Described, field, require, wire},
};

pub mod flag {
    /// End of the stream: carries no scan and follows the last one in order.
    pub const END: u32 = 1;
    /// The chain of motions starts here: there is no previous scan to match against.
    pub const BREAK: u32 = 2;
    /// On `pose`: the newest pose of the trajectory. After a restart the last poses are published
    /// again, and only the newest of them has this flag.
    pub const SYNC: u32 = 4;
    /// On `pose`: the trajectory is empty, and the stream begins with the first scan.
    pub const BASE: u32 = 8;

    pub(crate) const ALL: u32 = END | BREAK | SYNC | BASE;
}

gyre_geometry::named! {
    /// The stages of a pipeline in the order of the stream; a stage's value is the index of its
    /// [`Hop`]. A run has either the two decoupled searches or the joint one, and may lack
    /// refinement; the hops of missing stages stay zero.
    #[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
    #[repr(usize)]
    pub enum StageId {
        /// Reads the sensor or a recording.
        RadarReplay = "radar-replay",
        Masking = "masking",
        RotationSearch = "rotation-search",
        TranslationSearch = "translation-search",
        JointSearch = "joint-search",
        /// Refines the motion against the local map.
        Refinement = "refinement",
        PoseIntegration = "pose-integration",
    }
}

gyre_geometry::named! {
    /// The followers of a run, in the order of reading each other's logs. They read durable logs at
    /// their own pace and are not in the stream of scans, so they have no [`Hop`] and
    /// give no credit.
    #[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
    pub enum FollowerId {
        LoopClosure = "loop-closure",
        /// Corrects the trajectory by the loops.
        Trajectory = "trajectory",
        /// Finds the keyframes in the map of an earlier drive, in a run that names one.
        Localisation = "localisation",
        Objects = "objects",
    }
}

impl FollowerId {
    pub const fn is_in(self, window: &Window) -> bool {
        match self {
            Self::LoopClosure | Self::Trajectory => window.slam,
            Self::Localisation => window.localises,
            Self::Objects => window.objects,
        }
    }

    /// The property of a run with this follower, and the keys that give it.
    pub const fn needs(self) -> &'static str {
        match self {
            Self::LoopClosure | Self::Trajectory => "SLAM (slam.kind = \"graph\" or \"filter\")",
            Self::Localisation => "a map (slam.map, with slam.kind)",
            Self::Objects => "objects (objects.kind = \"tracks\")",
        }
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct HopTimes {
    pub stage: StageId,
    /// From the publication by the stage before to the reception; `None` for the first stage.
    pub transport_ns: Option<i64>,
    /// From the reception to the start of the work.
    pub wait_ns: i64,
    pub work_ns: i64,
}

pub type Hops = [Hop; StageId::ALL.len()];

wire! {
    /// Time stamps of one stage's work on a scan: `CLOCK_MONOTONIC`, ns; zero until then.
    pub struct Hop = "gyre_hop_v1" {
        /// The last input was taken from its queue.
        pub received_ns: i64,
        pub started_ns: i64,
        pub finished_ns: i64,
        pub published_ns: i64,
    }
}

wire! {
    /// The identity of a scan: its numbers and its times.
    pub struct Item = "gyre_item_v7" {
        /// Sequence number in the chain of motions: consecutive, from 0. Readers check it for gaps.
        pub seq: u64,
        /// Index of the scan in the recording, or the sensor's own count.
        pub scan: u64,
        /// The scan that this one is matched against (itself where the chain starts).
        pub previous_scan: u64,
        /// Sequence number at the source: a gap between consecutive items counts the scans dropped
        /// in live mode.
        pub published: u64,
        /// The first number that its generation gives. Items of earlier generations with this
        /// number or a later one are void: nothing was computed from them that lasts.
        pub numbered_from: u64,
        /// Number of commands to the run that apply to this scan. Masking sets it; it grows with
        /// the first scan of a command.
        pub commands: u64,
        /// Time of the middle of the sweep on the sensor's clock, ns since 1970.
        pub stamp_ns: i64,
        /// Time when the sweep was complete, or would have been at the sensor: `CLOCK_MONOTONIC`,
        /// ns. Latency is measured from here.
        pub due_ns: i64,
        /// Generation of the numbers: it grows when masking (live mode) or the source of a sensor
        /// is started, which may give a number again. 0 where the numbers follow from the
        /// recording.
        pub generation: u32,
        /// Bits of [`flag`].
        pub flags: u32 [Bounds::Bits(flag::ALL as u64)],
        /// Gaps where azimuths were lost, as masking has found them: the first and the last row
        /// before which a gap may be, and its number of azimuths, 0 behind the last gap. The pose
        /// keeps them for a masking that is restarted.
        pub lost: [[u16; 3]; MAX_GAPS],
        pub hops: Hops,
    }
}

impl Item {
    pub fn numbered(seq: u64) -> Self {
        Self {
            seq,
            ..Self::default()
        }
    }

    /// Returns the item of a record of a scan, which has no times of the run.
    pub fn recorded(seq: u64, scan: u64, stamp_ns: i64) -> Self {
        Self {
            scan,
            previous_scan: scan,
            stamp_ns,
            ..Self::numbered(seq)
        }
    }

    /// Returns it with these flags in the place of its own.
    #[must_use]
    pub fn flagged(self, flags: u32) -> Self {
        Self { flags, ..self }
    }

    pub fn lost_azimuths(&self) -> LostAzimuths {
        LostAzimuths::of_gaps(self.lost)
    }

    pub fn set_lost_azimuths(&mut self, lost: &LostAzimuths) {
        self.lost = Default::default();
        self.lost[..lost.gaps().len()].copy_from_slice(lost.gaps());
    }

    pub(crate) fn check(&self, limits: &Limits) -> Result<(), String> {
        Self::STRUCTURE.check(bytemuck::bytes_of(self), limits)?;
        let (scan, previous) = (self.scan, self.previous_scan);
        let expected = format_args!("at most {scan}, its scan");
        field(
            "previous_scan",
            require(previous <= scan, previous, expected),
        )?;
        for [first, last, azimuths] in self.lost {
            let end = usize::from(last) + usize::from(azimuths);
            field(
                "lost",
                require(
                    first <= last && end <= MAX_AZIMUTHS,
                    format_args!("{azimuths} before {first} to {last}"),
                    format_args!("two rows in order, within {MAX_AZIMUTHS} with the azimuths"),
                ),
            )?;
        }
        // The scan of the newest pose is sent again with its number.
        let (first, next) = (self.numbered_from, self.seq.saturating_add(1));
        let expected = format_args!("at most {next}, one more than its number");
        field("numbered_from", require(first <= next, first, expected))
    }

    /// Returns whether all of these flags are set.
    pub fn is(&self, flags: u32) -> bool {
        self.flags & flags == flags
    }

    /// Returns the number of scans that were published before this item and are not in its chain:
    /// what live mode dropped.
    pub fn dropped(&self) -> u64 {
        self.published.saturating_sub(self.seq)
    }

    /// Returns the durations at each stage that the scan has passed, in the order of the stream.
    pub fn hop_times(&self) -> impl Iterator<Item = HopTimes> {
        let mut before: Option<&Hop> = None;
        // Stages that the run does not have leave zeros.
        let passed = |(_, hop): &(StageId, &Hop)| **hop != Hop::default();
        let stages = StageId::ALL.into_iter().zip(&self.hops).filter(passed);
        stages.map(move |(stage, hop)| HopTimes {
            stage,
            transport_ns: before
                .replace(hop)
                .map(|before| hop.received_ns - before.published_ns),
            wait_ns: hop.started_ns - hop.received_ns,
            work_ns: hop.finished_ns - hop.started_ns,
        })
    }

    /// Returns the time from the complete sweep to its pose, ns, of an item of `pose`.
    pub fn sensor_to_pose_ns(&self) -> i64 {
        self.hops[StageId::PoseIntegration as usize].finished_ns - self.due_ns
    }

    pub fn hop_mut(&mut self, stage: StageId) -> &mut Hop {
        &mut self.hops[stage as usize]
    }
}

// Sizes are part of the wire format.
const _: () = assert!(size_of::<Hop>() == 32 && size_of::<Item>() == 120 + 7 * 32);
