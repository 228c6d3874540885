//! One fault: its random numbers, the moment when it happens, and the judgement of how the run
//! ended.

use std::{thread, time::Duration};

use gyre_journal as journal;
use gyre_messages::flag;
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rustix::process::Signal;

use super::drive::{Drive, Results};
use crate::common::{Ended, Pid, Run, Running, send};

/// The end of a run.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum End {
    /// It went on and is complete.
    Finished,
    /// It ended, and the same command made it complete.
    Resumed,
    /// It was refused, and changed nothing.
    Refused,
}

/// The end of a run with a fault that is as it must be.
#[derive(Debug)]
pub struct Outcome {
    /// The end.
    pub end: End,
    /// The times from a death to the first pose that the new process worked on.
    pub recovery_ms: Vec<f64>,
}

impl From<End> for Outcome {
    fn from(end: End) -> Self {
        Self {
            end,
            recovery_ms: Vec::new(),
        }
    }
}

impl Outcome {
    /// The same of a run that was refused.
    pub fn refused(self) -> Self {
        Self {
            end: End::Refused,
            ..self
        }
    }
}

/// A fault on its way.
pub struct Scene<'a> {
    /// The drive that is played.
    pub drive: &'a Drive,
    /// The source of all that is random.
    pub rng: ChaCha8Rng,
}

impl<'a> Scene<'a> {
    /// The fault of this seed.
    pub fn new(drive: &'a Drive, seed: u64) -> Self {
        let rng = ChaCha8Rng::seed_from_u64(seed);
        Self { drive, rng }
    }

    /// A run of the drive.
    pub fn run(&self) -> Run {
        self.drive.run()
    }

    /// True in one of `of` cases.
    pub fn one_in(&mut self, of: u32) -> bool {
        self.rng.random_ratio(1, of)
    }

    /// Sleeps for up to `limit_ms`.
    pub fn pause(&mut self, limit_ms: u64) {
        thread::sleep(Duration::from_millis(self.rng.random_range(0..=limit_ms)));
    }

    /// Waits for a random moment: while the processes start, or in the middle. `None` if the run is
    /// over.
    pub fn moment(&mut self, running: &mut Running) -> Option<()> {
        if self.one_in(6) {
            self.pause(200);
        } else {
            // The followers may have work to do after the last pose.
            running.await_poses_or_end(self.rng.random_range(1..=self.drive.scans));
            self.pause(20);
        }
        (!running.is_over()).then_some(())
    }

    /// A living stage or follower.
    pub fn stage(&mut self, running: &Running) -> Option<Pid> {
        let stages: Vec<Pid> = running.stages().into_values().collect();
        (!stages.is_empty()).then(|| stages[self.rng.random_range(0..stages.len())])
    }

    /// Kills a stage, if one lives.
    pub fn kill_stage(&mut self, running: &Running) -> Option<()> {
        let pid = self.stage(running)?;
        send(pid, Signal::KILL);
        Some(())
    }

    /// The run must have gone on to its end.
    pub fn finished(&self, run: &Run, ended: &Ended) -> Outcome {
        self.finished_with(&self.drive.undisturbed().results, run, ended)
    }

    /// The same where the results are others than those of the drive.
    pub fn finished_with(&self, expected: &Results, run: &Run, ended: &Ended) -> Outcome {
        ended.succeeded();
        assert_complete(run, expected);
        let recovery = run.summary()["recovery_ms"].as_array().unwrap().clone();
        Outcome {
            end: End::Finished,
            recovery_ms: recovery.iter().map(|ms| ms.as_f64().unwrap()).collect(),
        }
    }

    /// The run may have gone on to its end, or have ended with a sentence.
    pub fn survived(&self, run: &Run, ended: &Ended) -> Outcome {
        if ended.status.success() {
            return self.finished(run, ended);
        }
        assert_one_sentence(ended);
        self.resumed(run)
    }

    /// The same command must make the run complete, and lose none of the poses that are there.
    pub fn resumed(&self, run: &Run) -> Outcome {
        let records = journal::records(&journal::path(run.out())).unwrap();
        let records: Result<Vec<_>, _> = records.into_iter().flatten().collect();
        let records = records.unwrap();
        run.finish().succeeded();
        assert_complete(run, &self.drive.undisturbed().results);
        let resumed_after = run.summary()["resumed_after"].as_u64().unwrap() as usize;
        let was_complete = records.last().is_some_and(|last| last.item.is(flag::END));
        assert!(
            was_complete || resumed_after >= records.len(),
            "{} poses were there, but it resumed after {resumed_after}",
            records.len()
        );
        Outcome::from(End::Resumed)
    }
}

fn assert_complete(run: &Run, expected: &Results) {
    let results = Results::of(run);
    assert!(
        results == *expected,
        "the results are not those of the undisturbed run"
    );
    assert_eq!(run.summary()["ending"], "complete");
}

/// Returns its last words are the only sentence of the program; what comes before is the progress
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
