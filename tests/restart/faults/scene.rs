//! A fault: its random numbers, the moments when it happens, and the judgement of the run's end.

use std::{thread, time::Duration};

use gyre_contract::flag;
use gyre_journal as journal;
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rustix::process::Signal;

use super::configurations::{Configuration, Results};
use crate::common::{Ended, Pid, Run, Running, send};

const LOOK: Duration = Duration::from_millis(2);

pub struct Scene<'a> {
    pub configuration: &'a Configuration,
    pub rng: ChaCha8Rng,
}

impl<'a> Scene<'a> {
    pub fn new(configuration: &'a Configuration, seed: u64) -> Self {
        let rng = ChaCha8Rng::seed_from_u64(seed);
        Self { configuration, rng }
    }

    pub fn run(&self) -> Run {
        // All rows wait for it here and not in the middle of a run.
        self.configuration.undisturbed();
        self.configuration.run()
    }

    pub fn started(&self) -> (Run, Running) {
        let run = self.run();
        let running = run.start();
        (run, running)
    }

    pub fn processes(&self) -> Vec<String> {
        let undisturbed = self.configuration.undisturbed();
        undisturbed.processes.iter().cloned().collect()
    }

    pub fn one_in(&mut self, of: u32) -> bool {
        self.rng.random_ratio(1, of)
    }

    pub fn pause(&mut self, limit_ms: u64) {
        thread::sleep(Duration::from_millis(self.rng.random_range(0..=limit_ms)));
    }

    /// Numbers of poses for events, in order: early enough to see a restart.
    pub fn moments(&mut self, count: usize) -> Vec<usize> {
        let moments = self.configuration.moments();
        let end = moments.end.min(self.configuration.poses * 3 / 4);
        let random = |_| self.rng.random_range(moments.start..end);
        let mut moments: Vec<usize> = (0..count).map(random).collect();
        moments.sort_unstable();
        moments
    }

    /// Waits for a random moment: while the processes start, or in the middle. `None` if the run is
    /// over.
    pub fn moment(&mut self, running: &mut Running) -> Option<()> {
        if self.one_in(6) {
            self.pause(200);
        } else {
            // The followers may have work to do after the last pose.
            let moments = self.configuration.moments();
            running.await_poses_or_end(self.rng.random_range(moments));
            self.pause(20);
        }
        (!running.is_over()).then_some(())
    }

    pub fn stage(&mut self, running: &Running) -> Option<Pid> {
        let stages: Vec<Pid> = running.stages().into_values().collect();
        (!stages.is_empty()).then(|| stages[self.rng.random_range(0..stages.len())])
    }

    pub fn kill_stage(&mut self, running: &Running) -> Option<()> {
        let pid = self.stage(running)?;
        send(pid, Signal::KILL);
        Some(())
    }

    /// Kills a process once it lives, or asks it to end. `None` if the run is over.
    pub fn kill(&mut self, running: &mut Running, name: &str) -> Option<()> {
        while !running.is_over() {
            if let Some(pid) = running.stages().get(name) {
                let signal = if self.one_in(4) {
                    Signal::TERM
                } else {
                    Signal::KILL
                };
                send(*pid, signal);
                return Some(());
            }
            thread::sleep(LOOK);
        }
        None
    }

    /// The run must continue to its end. Returns `Some` as a fault that has struck, like the
    /// judgements below.
    pub fn finished(&self, run: &Run, running: Running) -> Option<()> {
        self.finished_with(&self.configuration.undisturbed().results, run, running)
    }

    /// The same for results that differ from the results of the configuration.
    pub fn finished_with(&self, expected: &Results, run: &Run, running: Running) -> Option<()> {
        running.finish().succeeded();
        self.assert_complete(run, expected)
    }

    /// Processes that were not killed must not have been restarted. `None` if one of the others was
    /// not restarted either: it died when its work was done.
    pub fn restarted(&self, run: &Run, killed: &[String]) -> Option<()> {
        let restarts = run.summary()["restarts"].clone();
        let restarts = restarts.as_object().unwrap();
        for name in restarts.keys() {
            assert!(killed.contains(name), "{name} was restarted: {restarts:?}");
        }
        let all = killed.iter().all(|name| restarts.contains_key(name));
        all.then_some(())
    }

    /// The run may have continued to its end, or have ended with a sentence.
    pub fn survived(&self, run: &Run, ended: &Ended) -> Option<()> {
        if ended.status.success() {
            ended.succeeded();
            return self.assert_complete(run, &self.configuration.undisturbed().results);
        }
        assert_one_sentence(ended);
        self.resumed(run)
    }

    /// The same command must make the run complete, and lose none of the poses that are there.
    pub fn resumed(&self, run: &Run) -> Option<()> {
        let records: Result<Vec<_>, _> = journal::poses(run.out()).unwrap().collect();
        let records = records.unwrap();
        run.finish().succeeded();
        self.assert_complete(run, &self.configuration.undisturbed().results);
        let resumed_after = run.summary()["resumed_after"].as_u64().unwrap() as usize;
        let was_complete = records.last().is_some_and(|last| last.item.is(flag::END));
        assert!(
            was_complete || resumed_after >= records.len(),
            "{} poses were there, but it resumed after {resumed_after}",
            records.len()
        );
        Some(())
    }

    fn assert_complete(&self, run: &Run, expected: &Results) -> Option<()> {
        let difference = expected.difference(&self.configuration.results(run));
        assert_eq!(difference, None, "differs from the undisturbed run");
        assert_eq!(run.summary()["ending"], "complete");
        Some(())
    }
}

/// Asserts that the last words are the program's only sentence; all earlier output is the progress
/// of the run.
pub fn assert_one_sentence(ended: &Ended) {
    ended.failed_with(&[]);
    let notice = |line: &&str| line.ends_with("; starting over");
    let sentences = ended
        .stderr
        .lines()
        .filter(|line| line.starts_with("gyre: ") && !notice(line));
    assert_eq!(sentences.count(), 1, "{}", ended.stderr);
}
