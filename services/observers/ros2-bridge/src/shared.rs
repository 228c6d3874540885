//! What the threads of the bridge share.

use std::{
    collections::VecDeque,
    path::PathBuf,
    sync::{
        Arc, Mutex, MutexGuard, PoisonError,
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
    /// The last runs by their names, which are others at each start.
    runs: Mutex<VecDeque<(String, KnownRun)>>,
    /// The run whose poses are published, or were.
    shown: Mutex<KnownRun>,
}

/// Runs that are kept for threads that begin with them late.
const KEPT: usize = 4;

/// What is known of one run. Each thread has that of the run it follows: another one may be at the next run already.
#[derive(Clone, Debug, Default)]
pub struct KnownRun(Arc<Mutex<Known>>);

impl KnownRun {
    /// Returns it for reading and writing.
    pub fn lock(&self) -> MutexGuard<'_, Known> {
        locked(&self.0)
    }
}

fn locked<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

/// What is known of a run.
#[derive(Clone, Debug, Default)]
pub struct Known {
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
            runs: Mutex::default(),
            shown: Mutex::default(),
        }
    }

    /// Begins with a run, or returns what is known of it if another thread has begun.
    pub fn begin(&self, manifest: &Manifest) -> KnownRun {
        self.begin_named(&manifest.prefix, manifest.window.slam)
    }

    fn begin_named(&self, name: &str, slam: bool) -> KnownRun {
        let mut runs = locked(&self.runs);
        if let Some((_, known)) = runs.iter().find(|(run, _)| run == name) {
            return known.clone();
        }
        let known = KnownRun::default();
        *known.lock() = Known {
            state: State::Working,
            // Before the first loop both frames are one.
            map_from_odometry: slam.then(Pose::identity),
            ..Known::default()
        };
        runs.push_back((name.to_owned(), known.clone()));
        if runs.len() > KEPT {
            runs.pop_front();
        }
        known
    }

    /// Makes a run the one that is shown.
    pub fn show(&self, known: &KnownRun) {
        *locked(&self.shown) = known.clone();
    }

    /// Returns the run that is shown.
    pub fn shown(&self) -> KnownRun {
        locked(&self.shown).clone()
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

    fn shared() -> Shared {
        Shared::new(PathBuf::new(), Frames::default(), Mounting::default())
    }

    #[test]
    fn a_thread_at_an_earlier_run_does_not_touch_the_next_one() {
        let shared = shared();
        let earlier = shared.begin_named("a", false);
        shared.show(&earlier);
        assert!(earlier.lock().count(7));
        let next = shared.begin_named("b", true);
        assert!(earlier.lock().count(8));
        earlier.lock().state = State::Ended;
        // It looks at the earlier run late, and begins with what is known of it.
        assert_eq!(shared.begin_named("a", false).lock().poses, 2);
        assert_eq!(next.lock().state, State::Working);
        assert!(next.lock().count(0), "a pose of another run is none before");
        assert_eq!(shared.shown().lock().state, State::Ended);
        shared.show(&next);
        let shown = shared.shown().lock().clone();
        assert_eq!((shown.poses, shown.missed), (1, 0));
        assert!(shown.map_from_odometry.is_some());
    }

    #[test]
    fn threads_that_follow_one_run_know_the_same_of_it() {
        let shared = shared();
        let of_maps = shared.begin_named("a", true);
        shared.begin_named("a", true).lock().maps += 1;
        assert_eq!(of_maps.lock().maps, 1);
        for later in 0..KEPT {
            shared.begin_named(&later.to_string(), true);
        }
        assert_eq!(locked(&shared.runs).len(), KEPT);
    }
}
