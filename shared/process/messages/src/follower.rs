//! Processes of a run that follow its logs.

use crate::limits::Window;

/// The followers of a run. They read durable logs at their own pace and are not in the
/// stream of scans, so they have no [`Hop`](crate::Hop) and give no credit.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum FollowerId {
    LoopClosure,
    /// Corrects the trajectory by the loops.
    Trajectory,
    /// Finds the keyframes in the map of an earlier drive, in a run that names one.
    Localisation,
    Objects,
}

impl FollowerId {
    /// All followers, in the order of reading each other's logs.
    pub const ALL: [Self; 4] = [
        Self::LoopClosure,
        Self::Trajectory,
        Self::Localisation,
        Self::Objects,
    ];

    /// The name used in configurations, on the command line and in results.
    pub const fn name(self) -> &'static str {
        match self {
            Self::LoopClosure => "loop-closure",
            Self::Trajectory => "trajectory",
            Self::Localisation => "localisation",
            Self::Objects => "objects",
        }
    }

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

    /// Returns the follower of this name.
    pub fn by_name(name: &str) -> Option<Self> {
        Self::ALL
            .into_iter()
            .find(|follower| follower.name() == name)
    }
}
