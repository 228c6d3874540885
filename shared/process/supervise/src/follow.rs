//! The supervision of followers: they are restarted alone, and waited for at the end of the stream. Odometry goes on without one that
//! dies again and again.

use std::time::{Duration, Instant};

use gyre_stage::{
    clock,
    follower::{self, Progress},
};

use crate::{Ending, Event, Stall, SuperviseError, Supervisor};

/// Stalls of a follower in a row after which the run ends.
const MAX_STALLS: usize = 3;

/// The clock of the follower that the run waits for.
#[derive(Default)]
struct Clock {
    /// The follower, its position, and since when it is there.
    at: Option<(usize, Progress, Instant)>,
    /// The farthest that this follower has been.
    farthest: u64,
    /// Its stalls without going farther.
    stalls_in_a_row: usize,
}

impl Clock {
    /// Returns for how long a process that was started then has been where it is.
    fn look(&mut self, follower: usize, progress: Progress, started: Instant) -> Duration {
        let since = match self.at {
            Some((of, at, since)) if (of, at) == (follower, progress) => since.max(started),
            _ => Instant::now(),
        };
        let is_same = self.at.is_some_and(|(of, ..)| of == follower);
        // A follower without a file of its own begins again at a restart.
        if !is_same || progress.done > self.farthest {
            (self.farthest, self.stalls_in_a_row) = (progress.done, 0);
        }
        self.at = Some((follower, progress, since));
        since.elapsed()
    }
}

impl Supervisor<'_> {
    /// Restarts dead followers while the stream goes on. The stages do not notice, and one that cannot be restarted does not end them.
    pub(crate) fn recover_followers(&mut self, dead: &[usize]) -> Result<(), SuperviseError> {
        for follower in dead {
            match self.recover_follower(*follower) {
                Err(error) if error.is_of_one_process() => {
                    let name = self.children[*follower].name();
                    (self.observe)(Event::GaveUp {
                        follower: name,
                        error: &error,
                    });
                    self.given_up.push((*follower, error));
                }
                recovered => recovered?,
            }
        }
        Ok(())
    }

    fn recover_follower(&mut self, dead: usize) -> Result<(), SuperviseError> {
        let died_ns = clock::now_ns();
        self.may_restart(&[dead])?;
        self.replace(&[dead], died_ns, None)?;
        self.say_restarted(&[dead]);
        Ok(())
    }

    /// Waits until the followers have read the logs to their end, or until they have that do not read what one writes that dies again
    /// and again. The stream has ended, so the death of a stage changes nothing.
    pub(crate) fn await_followers(&mut self) -> Result<Ending, SuperviseError> {
        self.is_following = true;
        // The last pose may have been the first of a program on trial.
        self.continue_trial();
        self.end_trial();
        self.end_swap()?;
        let mut clock = Clock::default();
        loop {
            // A follower reads what those before it write.
            let given_up = self.given_up.iter().map(|(follower, _)| *follower).min();
            let behind: Vec<usize> = (0..given_up.unwrap_or(self.children.len()))
                .filter(|i| self.is_behind(*i))
                .collect();
            let Some(first) = behind.first() else {
                return match self.given_up.pop() {
                    Some((_, error)) => Err(error),
                    None => Ok(Ending::Complete),
                };
            };
            self.end_stuck_follower(*first, &mut clock)?;
            if self.sleep()? || self.serve()? {
                return Ok(Ending::Interrupted);
            }
            (self.observe)(Event::Watched);
            self.logs.bound_if_due();
            self.keep_guardian();
            self.keep_recorder()?;
            let is_dead = |i: &usize| self.children[*i].has_exited() && self.is_behind(*i);
            let dead: Vec<usize> = behind.into_iter().filter(is_dead).collect();
            self.recover_followers(&dead)?;
        }
    }

    /// Says how far a follower is, and ends one that has stayed there for too long: it is then started again as after a death.
    fn end_stuck_follower(
        &mut self,
        child: usize,
        clock: &mut Clock,
    ) -> Result<(), SuperviseError> {
        let follower = &mut self.children[child];
        let progress = follower::progress_of(&self.plan.manifest, follower.name())
            .map_or_else(Progress::default, |(progress, _)| progress);
        (self.observe)(Event::Following {
            follower: follower.name(),
            progress,
        });
        let waited = clock.look(child, progress, follower.started());
        let Some(limit) = self.plan.stall_timeout.filter(|limit| waited > *limit) else {
            return Ok(());
        };
        let stall = Stall::Follower {
            follower: follower.name().to_owned(),
            limit,
        };
        clock.stalls_in_a_row += 1;
        if clock.stalls_in_a_row == MAX_STALLS {
            return Err(SuperviseError::Stalled(stall));
        }
        (self.observe)(Event::Stalled(&stall));
        follower.kill();
        follower.await_end()
    }

    /// Returns whether a process is a follower that has not come to its end, and may still do so.
    pub(crate) fn is_behind(&self, child: usize) -> bool {
        let has_given_up = self.given_up.iter().any(|(follower, _)| *follower == child);
        let child = &self.children[child];
        child.follows() && !has_given_up && !follower::is_done(&self.plan.manifest, child.name())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_clock_of_a_follower_runs_while_the_same_process_stays_where_it_is() {
        let mut clock = Clock::default();
        let past = Instant::now()
            .checked_sub(Duration::from_secs(60))
            .unwrap_or_else(Instant::now);
        let at = |done| Progress { done, total: 9 };
        clock.look(1, at(3), past);
        clock.stalls_in_a_row = 2;
        // As if it had been there for a minute.
        clock.at = Some((1, at(3), past));
        assert!(clock.look(1, at(3), past) >= Duration::from_secs(60));
        assert_eq!(clock.stalls_in_a_row, 2);
        let restarted = Instant::now();
        assert!(clock.look(1, at(3), restarted) < Duration::from_secs(60));
        assert_eq!(clock.stalls_in_a_row, 2);
        clock.look(1, at(4), restarted);
        assert_eq!(clock.stalls_in_a_row, 0);
    }

    #[test]
    fn a_follower_that_hangs_at_the_same_record_after_each_restart_stalls_in_a_row() {
        let mut clock = Clock::default();
        let mut be_at = |done| {
            clock.look(3, Progress { done, total: 9 }, Instant::now());
            clock.stalls_in_a_row += 1;
            clock.stalls_in_a_row
        };
        assert_eq!([be_at(4), be_at(0), be_at(4)], [1, 2, 3]);
        assert_eq!(be_at(5), 1, "it has gone farther");
    }
}
