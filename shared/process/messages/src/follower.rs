//! Processes of a run that follow its logs.

use crate::limits::Window;

crate::named! {
    /// The followers of a run, in the order of reading each other's logs. They read durable logs at
    /// their own pace and are not in the stream of scans, so they have no [`Hop`](crate::Hop) and
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
    /// Returns whether a run has this follower.
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
