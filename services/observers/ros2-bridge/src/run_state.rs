//! The state of the runs, which the threads of the bridge share.

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

use crate::{Mounting, clock::Clock};

pub struct Shared {
    pub out: PathBuf,
    pub frames: Frames,
    pub mounting: Mounting,
    stopping: AtomicBool,
    /// The last runs by their names, which are others at each start.
    runs: Mutex<VecDeque<(String, SharedRunState)>>,
    /// The run whose poses are published, or were.
    shown: Mutex<SharedRunState>,
}

/// Runs that are kept for threads that begin with them late.
const MAX_RUNS: usize = 4;

/// The state of one run. Another thread may follow the next run already.
#[derive(Clone, Debug, Default)]
pub struct SharedRunState(Arc<Mutex<RunState>>);

impl SharedRunState {
    pub fn lock(&self) -> MutexGuard<'_, RunState> {
        locked(&self.0)
    }
}

fn locked<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

#[derive(Clone, Debug, Default)]
pub struct RunState {
    pub phase: RunPhase,
    /// The clock of its stamps, from its first pose on.
    pub clock: Option<Clock>,
    pub map_from_odometry: Option<Pose>,
    pub poses: Counts,
    /// The scans whose objects are published, in a run that tracks them.
    pub objects: Counts,
    /// Messages for which readers left no room.
    pub unsent: u64,
    pub maps: u64,
    pub notice: Option<String>,
}

/// Counts of the messages of a topic, which have a number for each scan.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Counts {
    /// The number of the first one that was published: those before it came before the bridge.
    pub first: Option<u64>,
    pub newest: Option<u64>,
    pub published: u64,
    pub missed: u64,
}

impl Counts {
    /// Counts a message, and the messages missing before it. False for one that was published
    /// before.
    pub fn count(&mut self, seq: u64) -> bool {
        let next = self.newest.map_or(seq, |newest| newest + 1);
        if seq < next {
            return false;
        }
        self.first.get_or_insert(seq);
        self.missed += seq - next;
        self.newest = Some(seq);
        self.published += 1;
        true
    }
}

impl RunState {
    /// Returns a time of the run as a time of ROS, and whether it is the first one: by that the
    /// clock is set.
    pub fn stamp_ns(&mut self, time_ns: i64) -> (i64, bool) {
        let is_first = self.clock.is_none();
        let clock = self.clock.get_or_insert_with(|| Clock::of(time_ns));
        (clock.stamp_ns(time_ns), is_first)
    }

    /// Returns the number of messages that were not published or not sent.
    pub fn lost(&self) -> u64 {
        self.poses.missed + self.objects.missed + self.unsent
    }
}

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum RunPhase {
    /// There is no pose yet.
    #[default]
    Waiting,
    Working,
    /// The last scan has its pose; results are being written.
    Finishing,
    Ended,
}

impl Shared {
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

    /// Begins with a run, or returns its state if another thread has begun.
    pub fn begin(&self, name: &str, slam: bool) -> SharedRunState {
        let mut runs = locked(&self.runs);
        if let Some((_, state)) = runs.iter().find(|(run, _)| run == name) {
            return state.clone();
        }
        let state = SharedRunState::default();
        *state.lock() = RunState {
            phase: RunPhase::Working,
            // Before the first loop both frames are one.
            map_from_odometry: slam.then(Pose::identity),
            ..RunState::default()
        };
        runs.push_back((name.to_owned(), state.clone()));
        if runs.len() > MAX_RUNS {
            runs.pop_front();
        }
        state
    }

    pub fn show(&self, state: &SharedRunState) {
        *locked(&self.shown) = state.clone();
    }

    pub fn shown(&self) -> SharedRunState {
        locked(&self.shown).clone()
    }

    pub fn stop(&self) {
        self.stopping.store(true, Ordering::Relaxed);
    }

    pub fn is_stopping(&self) -> bool {
        self.stopping.load(Ordering::Relaxed)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_message_is_counted_once_and_gaps_are_missed() {
        let mut counts = Counts::default();
        let counted: Vec<bool> = [7, 8, 8, 7, 11, 12].map(|seq| counts.count(seq)).to_vec();
        assert_eq!(counted, [true, true, false, false, true, true]);
        assert_eq!((counts.first, counts.newest), (Some(7), Some(12)));
        assert_eq!((counts.published, counts.missed), (4, 2));
    }

    fn shared() -> Shared {
        Shared::new(PathBuf::new(), Frames::default(), Mounting::default())
    }

    #[test]
    fn a_thread_at_an_earlier_run_does_not_touch_the_next_one() {
        let shared = shared();
        let earlier = shared.begin("a", false);
        shared.show(&earlier);
        assert!(earlier.lock().poses.count(7));
        let next = shared.begin("b", true);
        assert!(earlier.lock().poses.count(8));
        earlier.lock().phase = RunPhase::Ended;
        // A thread that begins with the earlier run late gets its state.
        assert_eq!(shared.begin("a", false).lock().poses.published, 2);
        assert_eq!(next.lock().phase, RunPhase::Working);
        let is_new = next.lock().poses.count(0);
        assert!(is_new, "a pose of another run is none before");
        assert_eq!(shared.shown().lock().phase, RunPhase::Ended);
        shared.show(&next);
        let shown = shared.shown().lock().clone();
        assert_eq!((shown.poses.published, shown.poses.missed), (1, 0));
        assert!(shown.map_from_odometry.is_some());
    }

    #[test]
    fn threads_that_follow_one_run_share_its_state() {
        let shared = shared();
        let of_maps = shared.begin("a", true);
        shared.begin("a", true).lock().maps += 1;
        assert_eq!(of_maps.lock().maps, 1);
        for later in 0..MAX_RUNS {
            shared.begin(&later.to_string(), true);
        }
        assert_eq!(locked(&shared.runs).len(), MAX_RUNS);
    }
}
