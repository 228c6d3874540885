//! What is done about a run that makes no progress although no process has died.

use std::time::{Duration, Instant};

use gyre_messages::StageId;
use gyre_stage::{clock, wake};

use crate::{Event, Stall, SuperviseError, Supervisor, watchdog::Starting};

/// Time between two looks at the heartbeats.
const PERIOD: Duration = Duration::from_secs(1);
/// Time after which all processes have beaten again that can run.
const RESUMED: Duration = wake::MAX_WAIT.saturating_mul(5);

/// When the supervisor has looked for stalls.
pub(crate) struct Looks {
    last: Instant,
    /// The last look at the heartbeats.
    at_heartbeats: Instant,
    /// Until when old heartbeats say nothing.
    resumes_until: Option<Instant>,
}

impl Looks {
    pub fn new() -> Self {
        let now = Instant::now();
        Self {
            last: now,
            at_heartbeats: now,
            resumes_until: None,
        }
    }

    /// Returns whether this process itself was not run until a moment ago, as in a container that was frozen. Then all heartbeats
    /// are old.
    fn is_resuming(&mut self, now: Instant) -> bool {
        if now.duration_since(self.last) > RESUMED {
            self.resumes_until = Some(now + RESUMED);
        }
        self.last = now;
        self.resumes_until.is_some_and(|end| now < end)
    }

    fn is_time_for_heartbeats(&mut self, now: Instant) -> bool {
        let is_time = now.duration_since(self.at_heartbeats) >= PERIOD;
        if is_time {
            self.at_heartbeats = now;
        }
        is_time
    }
}

impl Supervisor<'_> {
    /// Returns the stall of the stages, if there is one.
    pub(crate) fn stall(&mut self) -> Option<Stall> {
        let now = Instant::now();
        if self.hangs.is_resuming(now) {
            self.watchdog.restarted();
            return None;
        }
        if self.hangs.is_time_for_heartbeats(now)
            && let Some(limit) = self.plan.stall_timeout
        {
            self.end_hanging_followers(limit);
            if let Some(hang) = self.hang(limit, limit) {
                return Some(hang);
            }
        }
        let opening = self.children.iter().filter(|child| {
            child
                .stage()
                .is_some_and(|stage| !self.services.has_publisher(stage))
        });
        let starting = opening
            .min_by_key(|child| child.started())
            .map(|child| Starting {
                stage: child.name(),
                since: child.started(),
            });
        let stall = self.watchdog.look(&self.plan.manifest, starting)?;
        let cause = match stall {
            // What is owed has been waited for since some time after the process began to hang.
            Stall::Pose { limit } | Stall::Scan { limit } => self.hang(limit / 2, limit),
            _ => None,
        };
        Some(cause.unwrap_or(stall))
    }

    /// Returns the stage that has hung for longer than `since`.
    fn hang(&self, since: Duration, limit: Duration) -> Option<Stall> {
        let child = self.all().find(|i| self.hangs(*i, since))?;
        Some(self.hang_of(child, limit))
    }

    fn hang_of(&self, child: usize, limit: Duration) -> Stall {
        Stall::Hang {
            process: self.children[child].name().to_owned(),
            limit,
        }
    }

    /// A stage that has not opened its topics is starting, and has a limit of its own.
    fn hangs(&self, child: usize, since: Duration) -> bool {
        let child = &self.children[child];
        let is_starting = |stage| !self.services.has_publisher(stage);
        let beat = child.heartbeat(&self.plan.manifest);
        !child.is_known_to_have_exited()
            && !child.stage().is_some_and(is_starting)
            && beat.is_some_and(|beat| beat.hangs(since))
    }

    /// Ends followers that hang. That counts as a death: odometry goes on, with them or without.
    fn end_hanging_followers(&mut self, limit: Duration) {
        for i in 0..self.children.len() {
            if self.children[i].follows() && self.hangs(i, limit) {
                let hang = self.hang_of(i, limit);
                (self.observe)(Event::Stalled(&hang));
                self.children[i].kill();
            }
        }
    }

    /// Restarts the processes that may be stuck: one that hangs alone; else first the source if it is late, and all but a live source
    /// otherwise. When that does not help, all stages; when that does not help either, the run ends.
    pub(crate) fn recover_from_stall(&mut self, stall: Stall) -> Result<(), SuperviseError> {
        let processes = match (self.watchdog.count(), &stall) {
            (1, Stall::Hang { process, .. }) => self
                .named(process)
                .map_or_else(Vec::new, |child| self.restarted_with(child)),
            (1, Stall::Scan { .. }) => self.sources(),
            (1, _) => self.all_but_survivors(&[]),
            (2, _) => self.all().collect(),
            _ => return Err(SuperviseError::Stalled(stall)),
        };
        (self.observe)(Event::Stalled(&stall));
        for i in &processes {
            self.count_restart(*i);
            if self.children[*i].is_on_trial() {
                self.go_back(*i, &stall.to_string());
            }
        }
        self.restart(&processes, clock::now_ns())
    }

    fn sources(&self) -> Vec<usize> {
        let is_source = |i: &usize| self.children[*i].stage() == Some(StageId::RadarReplay);
        (0..self.children.len()).filter(is_source).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn heartbeats_say_nothing_for_a_moment_after_the_supervisor_was_not_run() {
        let mut looks = Looks::new();
        let start = Instant::now();
        let mut is_resuming = |ms| looks.is_resuming(start + Duration::from_millis(ms));
        assert!(!is_resuming(200) && !is_resuming(400));
        assert!(is_resuming(60_000), "a minute is missing");
        assert!(is_resuming(60_200));
        assert!(!is_resuming(61_100));
    }
}
