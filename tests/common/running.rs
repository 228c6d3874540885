//! A running `gyre run`: what to wait for, and how to disturb it.

use std::{
    collections::BTreeMap,
    path::{Path, PathBuf},
    process::Child,
    thread,
    time::{Duration, Instant},
};

use gyre_journal as journal;
use rustix::process::Signal;

use super::{
    Ended, Pid, Run, STAGES, leftovers,
    processes::{self, send},
    spawned::{LIMIT, LOOK, Spawned},
};

/// The poses in the journal of a run, its end among them.
pub fn poses_of(out: &Path) -> usize {
    journal::poses(out).map_or(0, Iterator::count)
}

/// A running command. Dropped before its end, it is killed.
pub struct Running {
    run: Run,
    process: Spawned,
}

impl Running {
    pub(super) fn new(run: Run, child: Child) -> Self {
        let said = run.folder().join("stderr.txt");
        let process = Spawned { child, said };
        Self { run, process }
    }

    pub fn pid(&self) -> Pid {
        self.process.pid()
    }

    pub fn stages(&self) -> BTreeMap<String, Pid> {
        processes::stages_of(self.pid())
    }

    pub fn await_stages(&mut self) -> BTreeMap<String, Pid> {
        self.until("six stages", |running| {
            let living = running.stages();
            STAGES
                .iter()
                .all(|stage| living.contains_key(*stage))
                .then_some(living)
        })
    }

    pub fn await_stage(&mut self, name: &str) -> Pid {
        self.until(name, |running| running.stages().get(name).copied())
    }

    pub fn await_other_stage(&mut self, name: &str, not: Pid) -> Pid {
        self.until(name, |running| {
            running
                .stages()
                .get(name)
                .copied()
                .filter(|pid| *pid != not)
        })
    }

    /// Waits for a child other than `not` with this word in its command.
    pub fn await_child(&mut self, word: &str, not: Option<Pid>) -> Pid {
        self.until(word, |running| {
            processes::child_with(running.pid(), word).filter(|pid| Some(*pid) != not)
        })
    }

    pub fn await_poses(&mut self, poses: usize) -> &mut Self {
        self.until("poses", |running| (running.poses() >= poses).then_some(()));
        self
    }

    pub fn await_poses_or_end(&mut self, poses: usize) {
        while self.poses() < poses && !self.is_over() {
            thread::sleep(LOOK);
        }
    }

    pub fn is_over(&mut self) -> bool {
        self.process.is_over()
    }

    pub fn poses(&self) -> usize {
        poses_of(self.run.out())
    }

    pub fn shared_memory_bytes(&self) -> u64 {
        leftovers::bytes(self.run.out())
    }

    /// `kill -9` of a stage. Waits until it lives: poses that are on their way are still journalled
    /// while a stage is started again.
    pub fn kill(&mut self, stage: &str) -> &mut Self {
        send(self.await_stage(stage), Signal::KILL);
        self
    }

    pub fn signal(&self, signal: Signal) -> &Self {
        send(self.pid(), signal);
        self
    }

    pub fn await_words(&mut self, words: &str) -> &mut Self {
        self.until(words, |running| {
            running.process.said().contains(words).then_some(())
        });
        self
    }

    /// The root of the run, as a stage knows it; `None` if none lives.
    pub fn root(&self) -> Option<PathBuf> {
        self.stages().into_values().find_map(processes::run_of)
    }

    /// Waits until the run ends, and asserts that it leaves nothing behind.
    pub fn finish(self) -> Ended {
        let out = self.run.out().to_owned();
        let ended = self.end();
        leftovers::assert_nothing_left(&out);
        ended
    }

    /// Waits until the run ends well, and returns its `odometry.csv`.
    pub fn complete(self) -> String {
        let run = self.run.clone();
        self.finish().succeeded();
        run.odometry()
    }

    /// Ends the run as Ctrl-C does.
    pub fn interrupt(self) -> Ended {
        self.signal(Signal::INT);
        let ended = self.finish();
        assert_eq!(ended.code(), Some(130), "{}", ended.stderr);
        ended
    }

    /// Waits until the run ends, perhaps by a signal, which leaves its files to the next run.
    pub fn end(mut self) -> Ended {
        let status = self.process.wait();
        let ended = Ended {
            status,
            stdout: self.run.said("stdout.txt"),
            stderr: self.process.said(),
        };
        println!("{status}\n{}", ended.stderr);
        ended
    }

    /// `kill -9` of the supervisor; returns when its stages have followed it.
    pub fn kill_supervisor(mut self) {
        send(self.pid(), Signal::KILL);
        self.process.wait();
        let root = leftovers::root(self.run.out());
        let deadline = Instant::now() + Duration::from_secs(5);
        while !processes::of_run(&root).is_empty() {
            assert!(
                Instant::now() < deadline,
                "stages outlive their supervisor: {:?}",
                processes::of_run(&root)
            );
            thread::sleep(LOOK);
        }
    }

    fn until<T>(&mut self, what: &str, mut look: impl FnMut(&Self) -> Option<T>) -> T {
        let since = Instant::now();
        loop {
            if let Some(seen) = look(self) {
                return seen;
            }
            let (has_ended, said) = (self.is_over(), || self.process.said());
            assert!(!has_ended, "it ended before {what}:\n{}", said());
            assert!(since.elapsed() < LIMIT, "waited for {what}:\n{}", said());
            thread::sleep(LOOK);
        }
    }
}

impl Drop for Running {
    fn drop(&mut self) {
        if !self.is_over() {
            self.process.kill();
            leftovers::remove(self.run.out());
        }
    }
}
