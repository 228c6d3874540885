//! The state of the run, which the threads of the bridge share.

use std::{
    ops::Range,
    sync::{
        Mutex, MutexGuard, PoisonError,
        atomic::{AtomicBool, Ordering},
    },
    time::Duration,
};

use gyre_client::{clock, observer::Sequence};
use gyre_contract::Item;
use gyre_geometry::Pose;

use crate::{Settings, lifecycle::Lifecycle, motions::Motions};

/// The longest wait between two looks at the run.
pub const POLL_INTERVAL: Duration = Duration::from_millis(200);

pub struct Shared {
    pub settings: Settings,
    /// `None` if the node is not managed: then it is active.
    pub lifecycle: Option<Lifecycle>,
    stopping: AtomicBool,
    state: Mutex<RunState>,
}

#[derive(Clone, Debug, Default)]
pub struct RunState {
    pub phase: RunPhase,
    /// The offset from its stamps to times of ROS, ns, from its first pose on.
    offset_ns: Option<i64>,
    pub map_from_odometry: Option<Pose>,
    pub poses: Counts,
    /// The poses between scans.
    pub predictions: Counts,
    /// The scans whose objects are published, in a run that tracks them.
    pub objects: Counts,
    /// The scans whose velocity Doppler has measured.
    pub doppler: Counts,
    /// The keyframes that were found in the map of an earlier drive.
    pub fixes: Counts,
    pub motions: Motions,
    /// Poses that were sent before a reader of odometry was found, or after it left.
    pub unread: u64,
    /// Messages for which readers left no room.
    pub unsent: u64,
    pub maps: u64,
    pub notice: Option<String>,
}

/// Counts of the messages of a topic, which have a number for each scan.
#[derive(Clone, Debug, Default)]
pub struct Counts {
    /// The number of the first one that was published: those before it came before the bridge.
    pub first: Option<u64>,
    pub published: u64,
    /// Those that were not published, since the node was not active.
    pub held_back: u64,
    /// Those that contained nothing to publish, or poses that a prediction was ahead of.
    pub left_out: u64,
    sequence: Sequence,
}

impl Counts {
    /// Counts a message, and the messages missing before it; returns whether to publish it. False
    /// for one that was published before, or while the node is not active.
    pub fn count(&mut self, item: &Item, is_active: bool) -> bool {
        let is_new = self.sequence.advance(item).is_some();
        self.held_back += u64::from(is_new && !is_active);
        if is_new && is_active {
            self.first.get_or_insert(item.seq);
            self.published += 1;
        }
        is_new && is_active
    }

    /// Corrects the count of a message that is not published.
    pub fn leave_out(&mut self) {
        self.published -= 1;
        self.left_out += 1;
    }

    pub fn missed(&self) -> u64 {
        self.sequence.missed
    }
}

impl RunState {
    /// Returns a time of the run as a time of ROS. The first one sets the clock; a difference
    /// between the two is reported.
    pub fn stamp_ns(&mut self, time_ns: i64, say: fn(&str)) -> i64 {
        let offset_ns = *self.offset_ns.get_or_insert_with(|| {
            let offset_ns = offset_ns(time_ns, clock::since_1970_ns());
            if offset_ns != 0 {
                say(
                    "the times of this run do not count from 1970: its stamps in ROS begin with this computer's time at the first pose",
                );
            }
            offset_ns
        });
        time_ns.saturating_add(offset_ns)
    }

    /// Returns the number of messages that were not published or not sent.
    pub fn lost(&self) -> u64 {
        let counts = [
            &self.poses,
            &self.predictions,
            &self.objects,
            &self.doppler,
            &self.fixes,
        ];
        counts.map(Counts::missed).iter().sum::<u64>() + self.unsent
    }
}

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum RunPhase {
    #[default]
    Waiting,
    Working,
    Finishing,
    Ended,
}

impl Shared {
    pub fn new(settings: Settings, lifecycle: Option<Lifecycle>) -> Self {
        Self {
            settings,
            lifecycle,
            stopping: AtomicBool::new(false),
            state: Mutex::default(),
        }
    }

    pub fn state(&self) -> MutexGuard<'_, RunState> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Returns whether messages are published.
    pub fn is_active(&self) -> bool {
        self.lifecycle.as_ref().is_none_or(Lifecycle::is_active)
    }

    pub fn begin(&self, slam: bool) {
        *self.state() = RunState {
            phase: RunPhase::Working,
            // Before the first loop both frames are one.
            map_from_odometry: slam.then(Pose::identity),
            ..RunState::default()
        };
    }

    pub fn stop(&self) {
        self.stopping.store(true, Ordering::Relaxed);
    }

    /// Passes a sentence to the terminal.
    pub fn say(&self, sentence: &str) {
        (self.settings.say)(sentence);
    }

    /// Counts a message that was not sent.
    pub fn sent(&self, is_sent: bool) {
        self.state().unsent += u64::from(!is_sent);
    }

    pub fn is_stopping(&self) -> bool {
        self.stopping.load(Ordering::Relaxed)
    }
}

/// 2001-01-01, and the last second that ROS 2 can write, ns since 1970.
const YEARS_NS: Range<i64> = 978_307_200_000_000_000..(i32::MAX as i64) * 1_000_000_000;

/// Returns the offset from the stamps of a run to times of ROS, which count from 1970. The stamps
/// of a radar or a recording that has the time are left unchanged. All other stamps get the same
/// offset, so that the first stamp is the present time: intervals stay as the sensor measured them.
fn offset_ns(first_ns: i64, now_ns: i64) -> i64 {
    match YEARS_NS.contains(&first_ns) {
        true => 0,
        false => now_ns.saturating_sub(first_ns),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_left_out_does_not_count_as_published() {
        let mut counts = Counts::default();
        for seq in 0..3 {
            assert!(counts.count(&Item::numbered(seq), true));
        }
        counts.leave_out();
        assert_eq!(
            (counts.published, counts.left_out, counts.missed()),
            (2, 1, 0)
        );
    }

    const NOW_NS: i64 = 1_800_000_000_000_000_000;

    #[test]
    fn stamps_since_1970_are_the_sensors_and_others_begin_now() {
        assert_eq!(offset_ns(1_549_981_914_123_456_789, NOW_NS), 0);
        for first_ns in [0, 2_000_000_000, -1, i64::MAX] {
            let offset_ns = offset_ns(first_ns, NOW_NS);
            assert_eq!(first_ns.saturating_add(offset_ns), NOW_NS);
        }
    }
}
