//! Finds a run that makes no progress although no process has died, and decides what to restart.
//! The clock runs only while a pose is owed, or a scan by the source's own schedule: neither slow
//! playback nor a gap in a recording is a stall. A stage that opens its topics, maybe after loading
//! a model, has a limit of its own; stages on another machine are watched there.

use std::time::{Duration, Instant};

use gyre_contract::Item;
use gyre_stage::schedule::{self, Schedule};
use gyre_transport::wake;

use crate::{Plan, Stall};

/// Time between two looks at the heartbeats.
const PERIOD: Duration = Duration::from_secs(1);
/// Time after which all processes have beaten again that can run.
const RESUMED: Duration = wake::MAX_WAIT.saturating_mul(5);

pub(crate) struct Stalls<'a> {
    plan: &'a Plan,
    looks: Looks,
    /// Scans up to the scan of the newest pose, by `Item::published`.
    poses: u64,
    /// The owed item, and since when without any progress.
    owed: Option<(Stall, Instant)>,
    stalls_in_a_row: usize,
}

#[derive(Debug, Default, PartialEq, Eq)]
pub(crate) struct Found {
    /// Followers that hang: odometry continues, with them or without.
    pub followers: Vec<(usize, Stall)>,
    pub stall: Option<Stall>,
}

impl<'a> Stalls<'a> {
    pub fn of(plan: &'a Plan) -> Self {
        Self {
            plan,
            looks: Looks::new(),
            poses: 0,
            owed: None,
            stalls_in_a_row: 0,
        }
    }

    pub fn progress(&mut self, pose: &Item) {
        self.poses = pose.published.saturating_add(1);
        self.owed = None;
        self.stalls_in_a_row = 0;
    }

    pub fn restarted(&mut self) {
        self.owed = None;
    }

    /// Looks for stalls. `hangs` returns whether a process has not come to its next wait for longer
    /// than a time, and `starting` is the stage that has been opening its topics for longest, and
    /// since when.
    pub fn look(
        &mut self,
        now: Instant,
        hangs: impl Fn(usize, Duration) -> bool,
        starting: Option<(&str, Instant)>,
    ) -> Found {
        if self.looks.are_resuming(now) {
            self.restarted();
            return Found::default();
        }
        let mut followers = Vec::new();
        if self.looks.are_at_heartbeats(now)
            && let Some(limit) = self.plan.stall_timeout
        {
            let hanging = self.plan.followers().filter(|i| hangs(*i, limit));
            followers.extend(hanging.map(|i| (i, self.hang_of(i, limit))));
            let stall = self.hang(&hangs, limit, limit);
            if stall.is_some() {
                return Found { followers, stall };
            }
        }
        let stall = match starting {
            Some((stage, since)) => self.late_start(stage, since),
            None => self.late_message(),
        };
        let cause = match stall {
            // The wait for the due message began some time after the process began to hang.
            Some(Stall::Pose { limit } | Stall::Scan { limit }) => {
                self.hang(&hangs, limit / 2, limit)
            }
            _ => None,
        };
        Found {
            followers,
            stall: cause.or(stall),
        }
    }

    fn late_start(&mut self, stage: &str, since: Instant) -> Option<Stall> {
        self.owed = None;
        let limit = self.plan.start_timeout?;
        (since.elapsed() > limit).then(|| Stall::Start {
            stage: stage.to_owned(),
            limit,
        })
    }

    fn late_message(&mut self) -> Option<Stall> {
        let limit = self.plan.stall_timeout?;
        let owed = match schedule::owes(&self.plan.manifest, self.poses) {
            true => None,
            false => self.owed_by(schedule::read(&self.plan.manifest), limit),
        };
        self.owe(owed);
        let (stall, since) = self.owed.as_ref()?;
        (since.elapsed() > limit).then(|| stall.clone())
    }

    /// Returns the message that is due now. A source without a schedule always owes a scan, and so
    /// the run a pose.
    fn owed_by(&self, source: Option<Schedule>, limit: Duration) -> Option<Stall> {
        let Some(source) = source else {
            return Some(Stall::Pose { limit });
        };
        match (source.published > self.poses, source.is_late()) {
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

    /// Returns the stage that has hung for longer than `since`.
    fn hang(
        &self,
        hangs: impl Fn(usize, Duration) -> bool,
        since: Duration,
        limit: Duration,
    ) -> Option<Stall> {
        let process = self.plan.in_stream().find(|i| hangs(*i, since))?;
        Some(self.hang_of(process, limit))
    }

    fn hang_of(&self, process: usize, limit: Duration) -> Stall {
        Stall::Hang {
            process: self.plan.name(process).to_owned(),
            limit,
        }
    }

    /// Returns the processes to restart, which may be stuck: one that hangs alone; else first the
    /// source if it is late, and all but a live source otherwise. When that does not help, all
    /// stages; `None` when that does not help either.
    pub fn remedy(&mut self, stall: &Stall) -> Option<Vec<usize>> {
        let plan = self.plan;
        self.stalls_in_a_row += 1;
        Some(match (self.stalls_in_a_row, stall) {
            (1, Stall::Hang { process, .. }) => plan
                .named(process)
                .map_or_else(Vec::new, |process| plan.restarted_with(process)),
            (1, Stall::Scan { .. }) => plan.sources(),
            (1, _) => plan.all_but_survivors(&[]),
            (2, _) => plan.in_stream().collect(),
            _ => return None,
        })
    }
}

/// When the supervisor has looked for stalls.
struct Looks {
    last: Instant,
    at_heartbeats: Instant,
    /// Until then, old heartbeats are no evidence.
    resumes_until: Option<Instant>,
}

impl Looks {
    fn new() -> Self {
        let now = Instant::now();
        Self {
            last: now,
            at_heartbeats: now,
            resumes_until: None,
        }
    }

    /// Returns whether this process itself was not run until a moment ago, as in a container that
    /// was frozen. Then all heartbeats are old.
    fn are_resuming(&mut self, now: Instant) -> bool {
        if now.duration_since(self.last) > RESUMED {
            self.resumes_until = Some(now + RESUMED);
        }
        self.last = now;
        self.resumes_until.is_some_and(|end| now < end)
    }

    fn are_at_heartbeats(&mut self, now: Instant) -> bool {
        let is_time = now.duration_since(self.at_heartbeats) >= PERIOD;
        if is_time {
            self.at_heartbeats = now;
        }
        is_time
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tests::{FOLLOWER, LIMIT, MASKING, REFINEMENT, SOURCE, plan};
    use gyre_transport::clock;

    /// Looks when the heartbeats are due and each of these processes has hung for a time.
    fn found(stalls: &mut Stalls<'_>, hanging: &[usize], time: Duration) -> Found {
        let now = stalls.looks.last + RESUMED;
        let hangs = |process, since| hanging.contains(&process) && time > since;
        stalls.look(now, hangs, None)
    }

    #[test]
    fn heartbeats_say_nothing_for_a_moment_after_the_supervisor_was_not_run() {
        let mut looks = Looks::new();
        let start = Instant::now();
        let mut are_resuming = |ms| looks.are_resuming(start + Duration::from_millis(ms));
        assert!(!are_resuming(200) && !are_resuming(400));
        assert!(are_resuming(60_000), "a minute is missing");
        assert!(are_resuming(60_200));
        assert!(!are_resuming(61_100));
    }

    #[test]
    fn a_run_that_was_frozen_has_not_stalled() {
        let plan = plan();
        let mut stalls = Stalls::of(&plan);
        stalls.owe(Some(Stall::Pose { limit: LIMIT }));
        let all_hang = |_: usize, _: Duration| true;
        let thawed = stalls.looks.last + 60 * RESUMED;
        assert_eq!(stalls.look(thawed, all_hang, None), Found::default());
        assert_eq!(stalls.owed, None, "what was due then is due anew");
        // Those that hang still a moment later do hang.
        let found = stalls.look(thawed + RESUMED, all_hang, None);
        assert!(found.stall.is_some());
    }

    #[test]
    fn a_stage_that_hangs_is_a_stall_and_a_follower_that_hangs_is_none() {
        let plan = plan();
        let mut stalls = Stalls::of(&plan);
        assert_eq!(found(&mut stalls, &[MASKING], LIMIT / 2), Found::default());
        let both = found(&mut stalls, &[MASKING, FOLLOWER], 2 * LIMIT);
        let follower = stalls.hang_of(FOLLOWER, LIMIT);
        assert_eq!(both.followers, [(FOLLOWER, follower.clone())]);
        assert_eq!(both.stall, Some(stalls.hang_of(MASKING, LIMIT)));
        let one = found(&mut stalls, &[FOLLOWER], 2 * LIMIT);
        assert_eq!(
            (one.followers, one.stall),
            (vec![(FOLLOWER, follower)], None)
        );
        // Heartbeats are looked at once a second.
        let now = stalls.looks.last + PERIOD / 2;
        assert_eq!(stalls.look(now, |_, _| true, None), Found::default());
    }

    #[test]
    fn a_stage_that_hangs_is_restarted_alone_then_all_are_and_then_the_run_ends() {
        let plan = plan();
        let mut stalls = Stalls::of(&plan);
        let stall = stalls.hang_of(MASKING, LIMIT);
        assert_eq!(stalls.remedy(&stall), Some(vec![MASKING]));
        let all = vec![SOURCE, MASKING, REFINEMENT];
        assert_eq!(stalls.remedy(&stall), Some(all));
        assert_eq!(stalls.remedy(&stall), None);
        stalls.progress(&Item::default());
        assert_eq!(stalls.remedy(&stall), Some(vec![MASKING]), "after a pose");
    }

    #[test]
    fn a_late_scan_is_the_sources_and_a_late_pose_not_that_of_a_live_source() {
        let mut plan = plan();
        plan.stages[SOURCE].outlives_restarts = true;
        let mut stalls = Stalls::of(&plan);
        let late = stalls.remedy(&Stall::Scan { limit: LIMIT });
        assert_eq!(late, Some(vec![SOURCE]));
        stalls.progress(&Item::default());
        let late = stalls.remedy(&Stall::Pose { limit: LIMIT });
        assert_eq!(late, Some(vec![MASKING, REFINEMENT]));
        let late = stalls.remedy(&Stall::Pose { limit: LIMIT });
        assert_eq!(late, Some(vec![SOURCE, MASKING, REFINEMENT]));
    }

    #[test]
    fn a_published_scan_owes_its_pose_and_a_source_the_scan_that_is_due() {
        let plan = plan();
        let (pose, scan) = (Stall::Pose { limit: LIMIT }, Stall::Scan { limit: LIMIT });
        let mut stalls = Stalls::of(&plan);
        for (poses, published, due_in_s, expected) in [
            (0, 0, 3600, None),
            (7, 7, 3600, None),
            (0, 1, 3600, Some(&pose)),
            (7, 8, 3600, Some(&pose)),
            (7, 8, -1, Some(&pose)),
            (0, 0, -1, Some(&scan)),
            (7, 7, -1, Some(&scan)),
        ] {
            stalls.poses = poses;
            let due_ns = clock::now_ns() + due_in_s * 1_000_000_000;
            let source = Schedule { published, due_ns };
            let owed = stalls.owed_by(Some(source), LIMIT);
            assert_eq!(owed.as_ref(), expected, "{poses}, {published}, {due_in_s}");
        }
        let without_schedule = stalls.owed_by(None, LIMIT);
        assert_eq!(without_schedule, Some(pose));
    }

    #[test]
    fn the_clock_runs_while_the_same_is_owed_and_stops_at_a_pose() {
        let plan = plan();
        let mut stalls = Stalls::of(&plan);
        let pose = || Some(Stall::Pose { limit: LIMIT });
        stalls.owe(pose());
        let since = stalls.owed.clone();
        stalls.owe(pose());
        assert_eq!(stalls.owed, since);
        stalls.progress(&Item::default());
        assert_eq!(stalls.owed, None);
        stalls.owe(pose());
        stalls.owe(None);
        assert_eq!(stalls.owed, None);
    }
}
