//! Finds a run that makes no progress although no process has died.
//!
//! The clock runs only while something is owed: a pose, of an item that the source has published,
//! or an item that the source should have published by its own schedule. So neither slow playback
//! nor a gap in a recording is a stall. A stage that has not opened its topics is starting: it may
//! load a model, and has a limit of its own. What stages on another machine owe is watched there.

use std::time::{Duration, Instant};

use gyre_messages::Item;
use gyre_stage::{
    Manifest, remote_progress,
    schedule::{self, Schedule},
};

use crate::{Plan, Stall};

/// The clock of a run's stalls.
pub(crate) struct Watchdog {
    stall_timeout: Option<Duration>,
    start_timeout: Option<Duration>,
    /// `Item::published` of the newest pose.
    newest: Option<u64>,
    /// The owed item, and since when without any progress.
    owed: Option<(Stall, Instant)>,
    stalls_in_a_row: usize,
}

/// A stage that has not opened its topics.
pub(crate) struct Starting<'a> {
    pub stage: &'a str,
    pub since: Instant,
}

impl Watchdog {
    pub fn new(plan: &Plan) -> Self {
        Self {
            stall_timeout: plan.stall_timeout,
            start_timeout: plan.start_timeout,
            newest: None,
            owed: None,
            stalls_in_a_row: 0,
        }
    }

    /// Resets the clock at a new pose.
    pub fn progress(&mut self, pose: &Item) {
        self.newest = Some(pose.published);
        self.owed = None;
        self.stalls_in_a_row = 0;
    }

    /// Resets the clock at a restart.
    pub fn restarted(&mut self) {
        self.owed = None;
    }

    /// Returns the stall, if something has been owed for too long.
    pub fn look(&mut self, manifest: &Manifest, starting: Option<Starting<'_>>) -> Option<Stall> {
        if let Some(starting) = starting {
            self.owed = None;
            let limit = self.start_timeout?;
            return (starting.since.elapsed() > limit).then(|| Stall::Start {
                stage: starting.stage.to_owned(),
                limit,
            });
        }
        let limit = self.stall_timeout?;
        let poses = self.newest.map_or(0, |newest| newest.saturating_add(1));
        let owed = match remote_progress::owes(manifest, poses) {
            true => None,
            false => self.owed_by(schedule::read(manifest), limit),
        };
        self.owe(owed);
        let (stall, since) = self.owed.as_ref()?;
        (since.elapsed() > limit).then(|| stall.clone())
    }

    /// Counts a stall; returns how many there were in a row.
    pub fn count(&mut self) -> usize {
        self.stalls_in_a_row += 1;
        self.stalls_in_a_row
    }

    /// Returns the message that is due now. A source without a schedule always owes a scan, and so
    /// the run a pose.
    fn owed_by(&self, source: Option<Schedule>, limit: Duration) -> Option<Stall> {
        let Some(source) = source else {
            return Some(Stall::Pose { limit });
        };
        let poses = self.newest.map_or(0, |newest| newest.saturating_add(1));
        match (source.published > poses, source.is_late()) {
            (true, _) => Some(Stall::Pose { limit }),
            (false, true) => Some(Stall::Scan { limit }),
            (false, false) => None,
        }
    }

    /// Keeps the clock running as long as the same is owed.
    fn owe(&mut self, stall: Option<Stall>) {
        if self.owed.as_ref().map(|(owed, _)| owed) != stall.as_ref() {
            self.owed = stall.map(|stall| (stall, Instant::now()));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use gyre_stage::clock;

    const LIMIT: Duration = Duration::from_secs(1);

    fn watchdog(newest: Option<u64>) -> Watchdog {
        Watchdog {
            stall_timeout: Some(LIMIT),
            start_timeout: None,
            newest,
            owed: None,
            stalls_in_a_row: 0,
        }
    }

    #[test]
    fn a_published_scan_owes_its_pose_and_a_source_the_scan_that_is_due() {
        let (pose, scan) = (Stall::Pose { limit: LIMIT }, Stall::Scan { limit: LIMIT });
        for (newest, published, due_in_s, expected) in [
            (None, 0, 3600, None),
            (Some(6), 7, 3600, None),
            (None, 1, 3600, Some(&pose)),
            (Some(6), 8, 3600, Some(&pose)),
            (Some(6), 8, -1, Some(&pose)),
            (None, 0, -1, Some(&scan)),
            (Some(6), 7, -1, Some(&scan)),
        ] {
            let due_ns = clock::now_ns() + due_in_s * 1_000_000_000;
            let source = Schedule { published, due_ns };
            let owed = watchdog(newest).owed_by(Some(source), LIMIT);
            assert_eq!(
                owed.as_ref(),
                expected,
                "{newest:?}, {published}, {due_in_s}"
            );
        }
        let without_schedule = watchdog(Some(6)).owed_by(None, LIMIT);
        assert_eq!(without_schedule, Some(pose));
    }

    #[test]
    fn the_clock_runs_while_the_same_is_owed_and_stops_at_a_pose() {
        let mut watchdog = watchdog(None);
        let pose = || Some(Stall::Pose { limit: LIMIT });
        watchdog.owe(pose());
        let since = watchdog.owed.clone();
        watchdog.owe(pose());
        assert_eq!(watchdog.owed, since);
        watchdog.progress(&Item::default());
        assert_eq!(watchdog.owed, None);
        watchdog.owe(pose());
        watchdog.owe(None);
        assert_eq!(watchdog.owed, None);
    }
}
