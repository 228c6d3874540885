//! What is done about a run that makes no progress although no process has died.

use std::time::{Duration, Instant};

use gyre_messages::StageId;

use super::{Event, Stall, SuperviseError, Supervisor, watchdog::Starting};
use crate::clock;

/// Time between two looks at the heartbeats.
const PERIOD: Duration = Duration::from_secs(1);

impl Supervisor<'_> {
    /// Returns the stall, if there is one.
    pub(super) fn stall(&mut self) -> Option<Stall> {
        if let Some(hang) = self.hang_if_due() {
            return Some(hang);
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

    /// Returns the process that hangs, by its heartbeat, if it is time to look.
    fn hang_if_due(&mut self) -> Option<Stall> {
        if self.looked_for_hangs.elapsed() < PERIOD {
            return None;
        }
        self.looked_for_hangs = Instant::now();
        let limit = self.plan.stall_timeout?;
        self.hang(limit, limit)
    }

    /// Returns the process that has hung for longer than `since`.
    fn hang(&self, since: Duration, limit: Duration) -> Option<Stall> {
        let child = (0..self.children.len()).find(|i| self.hangs(*i, since))?;
        Some(Stall::Hang {
            process: self.children[child].name().to_owned(),
            limit,
        })
    }

    fn hangs(&self, child: usize, since: Duration) -> bool {
        let child = &self.children[child];
        let beat = child.heartbeat(&self.plan.manifest);
        !child.is_known_to_have_exited() && beat.is_some_and(|beat| beat.hangs(since))
    }

    /// Restarts the processes that may be stuck: one that hangs alone; else first the source if it is late, and all but a live source
    /// otherwise. When that does not help, all stages; when that does not help either, the run ends.
    pub(super) fn recover_from_stall(&mut self, stall: Stall) -> Result<(), SuperviseError> {
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
        self.restart(&processes, clock::now_ns())?;
        (self.observe)(Event::Restarted {
            all: processes.len() > 1,
        });
        Ok(())
    }

    fn sources(&self) -> Vec<usize> {
        let is_source = |i: &usize| self.children[*i].stage() == Some(StageId::RadarReplay);
        (0..self.children.len()).filter(is_source).collect()
    }
}
