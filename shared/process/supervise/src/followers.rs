//! The supervision of followers: they are restarted alone, and waited for at the end of the stream.
//! Odometry continues without a follower that dies again and again.

use std::time::{Duration, Instant};

use gyre_stage::follower::{self, Progress};

use crate::{Ending, Plan, Stall, SuperviseError};

const MAX_STALLS: usize = 3;

/// The clock of the follower that the run waits for.
#[derive(Default)]
struct Clock {
    /// The follower, its position, and since when it is there.
    at: Option<(usize, Progress, Instant)>,
    farthest: u64,
    /// The stalls without going farther.
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

pub(crate) struct Followers<'a> {
    plan: &'a Plan,
    /// True when the stream has ended, and followers are waited for.
    pub are_awaited: bool,
    clock: Clock,
    /// Those that are not restarted any more, and why.
    pub given_up: Vec<(usize, String)>,
}

#[derive(Debug, PartialEq, Eq)]
pub(crate) enum Patience {
    Wait,
    /// It has stayed where it is for too long: it is ended, and then started again as after a
    /// death.
    End(Stall),
    GiveUp(Stall),
}

impl<'a> Followers<'a> {
    pub fn of(plan: &'a Plan) -> Self {
        Self {
            plan,
            are_awaited: false,
            clock: Clock::default(),
            given_up: Vec::new(),
        }
    }

    pub fn has_given_up(&self, process: usize) -> bool {
        self.given_up.iter().any(|(it, _)| *it == process)
    }

    /// Returns whether a process is a follower that has not come to its end, and may still do so.
    pub fn is_behind(&self, process: usize) -> bool {
        let is_done = || self.progress_of(process).1;
        self.plan.follows(process) && !self.has_given_up(process) && !is_done()
    }

    /// No follower reads a log of one that was given up, or one behind it.
    pub fn behind(&self) -> Vec<usize> {
        let given_up = self.given_up.iter().map(|(follower, _)| *follower).min();
        let followers = self.plan.followers();
        let reach_the_end = followers.filter(|i| given_up.is_none_or(|first| *i < first));
        reach_the_end.filter(|i| self.is_behind(*i)).collect()
    }

    /// Returns how the run ends when no follower is behind any more.
    pub fn end(&mut self) -> Result<Ending, SuperviseError> {
        match self.given_up.pop() {
            Some((_, reason)) => Err(SuperviseError::Process(reason)),
            None => Ok(Ending::Complete),
        }
    }

    /// Returns the progress of a follower, and whether it has come to its end.
    pub fn progress_of(&self, follower: usize) -> (Progress, bool) {
        let name = self.plan.name(follower);
        follower::progress_of(&self.plan.manifest, name).unwrap_or_default()
    }

    pub fn judge(&mut self, follower: usize, progress: Progress, started: Instant) -> Patience {
        let waited = self.clock.look(follower, progress, started);
        let Some(limit) = self.plan.stall_timeout.filter(|limit| waited > *limit) else {
            return Patience::Wait;
        };
        let stall = Stall::Follower {
            follower: self.plan.name(follower).to_owned(),
            limit,
        };
        self.clock.stalls_in_a_row += 1;
        match self.clock.stalls_in_a_row == MAX_STALLS {
            true => Patience::GiveUp(stall),
            false => Patience::End(stall),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tests::{FOLLOWER, LIMIT, MASKING, plan};

    #[test]
    fn a_follower_that_stays_where_it_is_is_ended_and_after_the_third_time_the_run() {
        let plan = plan();
        let mut followers = Followers::of(&plan);
        let past = Instant::now()
            .checked_sub(2 * LIMIT)
            .unwrap_or_else(Instant::now);
        let at = Progress { done: 3, total: 9 };
        assert_eq!(followers.judge(FOLLOWER, at, past), Patience::Wait);
        let mut stays = || {
            // As if it had been there for long.
            followers.clock.at = Some((FOLLOWER, at, past));
            followers.judge(FOLLOWER, at, past)
        };
        let stall = || Stall::Follower {
            follower: "loop-closure".to_owned(),
            limit: LIMIT,
        };
        assert_eq!(stays(), Patience::End(stall()));
        assert_eq!(stays(), Patience::End(stall()));
        assert_eq!(stays(), Patience::GiveUp(stall()));
    }

    #[test]
    fn a_follower_that_is_given_up_is_not_waited_for_and_its_error_ends_the_run() {
        let plan = plan();
        let mut followers = Followers::of(&plan);
        assert!(followers.is_behind(FOLLOWER) && !followers.is_behind(MASKING));
        assert_eq!(followers.behind(), [FOLLOWER]);
        assert!(matches!(followers.end(), Ok(Ending::Complete)));
        followers.given_up.push((FOLLOWER, "it dies".to_owned()));
        assert!(!followers.is_behind(FOLLOWER) && followers.behind().is_empty());
        assert!(followers.end().is_err());
    }

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
