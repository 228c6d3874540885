//! What the threads of the bridge share.

use std::{
    path::PathBuf,
    sync::{
        Mutex, MutexGuard, PoisonError,
        atomic::{AtomicBool, Ordering},
    },
};

use gyre_geometry::Pose;
use gyre_ros2_messages::frames::Frames;
use gyre_stage::Manifest;

use crate::{Mounting, clock::Clock};

/// What the threads share.
pub struct Shared {
    /// The folder of the results of the run.
    pub out: PathBuf,
    /// Names of the frames.
    pub frames: Frames,
    /// The radar on the vehicle.
    pub mounting: Mounting,
    stopping: AtomicBool,
    known: Mutex<Known>,
}

/// What is known of the run.
#[derive(Clone, Debug, Default)]
pub struct Known {
    /// Which run: another name at each start.
    pub run: String,
    /// Where it is.
    pub state: State,
    /// The clock of its stamps, from its first pose on.
    pub clock: Option<Clock>,
    /// The odometry frame in the map frame, both of the radar, in a run with SLAM.
    pub map_from_odometry: Option<Pose>,
    /// The number of the first pose that was published: those before it came before the bridge.
    pub first: Option<u64>,
    /// The number of the newest pose.
    pub newest: Option<u64>,
    /// Poses that were published.
    pub poses: u64,
    /// Poses that came too fast for the bridge.
    pub missed: u64,
    /// Messages for which readers left no room.
    pub unsent: u64,
    /// Maps that were published.
    pub maps: u64,
    /// Why something is not published.
    pub notice: Option<String>,
}

impl Known {
    /// Counts a pose, and what is missing before it. False for one that was published before.
    pub fn count(&mut self, seq: u64) -> bool {
        let next = self.newest.map_or(seq, |newest| newest + 1);
        if seq < next {
            return false;
        }
        self.first.get_or_insert(seq);
        self.missed += seq - next;
        self.newest = Some(seq);
        self.poses += 1;
        true
    }
}

/// Where a run is.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum State {
    /// There is none yet.
    #[default]
    Waiting,
    /// It works.
    Working,
    /// The last scan has its pose; results are being written.
    Finishing,
    /// It has ended.
    Ended,
}

impl Shared {
    /// Before the first run.
    pub fn new(out: PathBuf, frames: Frames, mounting: Mounting) -> Self {
        Self {
            out,
            frames,
            mounting,
            stopping: AtomicBool::new(false),
            known: Mutex::default(),
        }
    }

    /// What is known of the run.
    pub fn known(&self) -> MutexGuard<'_, Known> {
        self.known.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Begins with a run, unless another thread has: all that was known is of an earlier one, but for what is counted of the bridge itself.
    pub fn begin(&self, manifest: &Manifest) {
        let mut known = self.known();
        if known.run != manifest.prefix {
            *known = Known {
                run: manifest.prefix.clone(),
                state: State::Working,
                // Before the first loop both frames are one.
                map_from_odometry: manifest.window.slam.then(Pose::identity),
                unsent: known.unsent,
                ..Known::default()
            };
        }
    }

    /// Asks all threads to end.
    pub fn stop(&self) {
        self.stopping.store(true, Ordering::Relaxed);
    }

    /// Returns whether they are to end.
    pub fn is_stopping(&self) -> bool {
        self.stopping.load(Ordering::Relaxed)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_pose_is_counted_once_and_gaps_are_missed() {
        let mut known = Known::default();
        let counted: Vec<bool> = [7, 8, 8, 7, 11, 12].map(|seq| known.count(seq)).to_vec();
        assert_eq!(counted, [true, true, false, false, true, true]);
        assert_eq!((known.first, known.newest), (Some(7), Some(12)));
        assert_eq!((known.poses, known.missed), (4, 2));
    }
}
