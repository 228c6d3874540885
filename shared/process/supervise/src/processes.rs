//! The processes of a run: the stages in the order of the stream, then the followers.

use std::{
    collections::BTreeMap,
    fs,
    ops::{Deref, DerefMut},
    time::{Duration, Instant},
};

use gyre_contract::PoseHeader;
use gyre_stage::sink;
use gyre_transport::{Manifest, wake};

use crate::{
    END_TIMEOUT, Ending, Event, Plan, SuperviseError, child::Child, followers::Followers,
    guardian::Guardian, recovery::Recovery, run::Run,
};

/// Time without progress of a process that writes the poses that it held while the disk was full.
const CATCH_UP: Duration = Duration::from_secs(10);

#[derive(Default)]
pub(crate) struct Processes {
    children: Vec<Child>,
    pub restarts: BTreeMap<String, usize>,
}

impl Deref for Processes {
    type Target = [Child];

    fn deref(&self) -> &[Child] {
        &self.children
    }
}

impl DerefMut for Processes {
    fn deref_mut(&mut self) -> &mut [Child] {
        &mut self.children
    }
}

impl Processes {
    pub fn start(&mut self, run: &mut Run<'_>) -> Result<(), SuperviseError> {
        let plan = run.plan;
        for stage in &plan.stages {
            let child = Child::spawn(stage, &run.starter(), false)?;
            run.note(&format!("{:20} pid {}", stage.name, child.pid()));
            self.children.push(child);
        }
        Ok(())
    }

    /// Returns the followers and the stages that have ended.
    pub fn ended(&mut self, plan: &Plan) -> (Vec<usize>, Vec<usize>) {
        let children = self.children.iter_mut().enumerate();
        let ended = children.filter_map(|(i, child)| child.has_exited().then_some(i));
        ended.partition(|i| plan.follows(*i))
    }

    /// Returns the stage that has been opening its topics for longest.
    pub fn starting(&self, run: &Run<'_>) -> Option<&Child> {
        let opening = self.iter().filter(|child| child.is_starting(run));
        opening.min_by_key(|child| child.started)
    }

    /// Returns whether a process has not come to its next wait for longer than `since`. A stage
    /// that has not opened its topics is starting, and has a limit of its own.
    pub fn hangs(&self, process: usize, since: Duration, run: &Run<'_>) -> bool {
        let child = &self[process];
        let beat = child.heartbeat(run.manifest());
        !child.is_known_to_have_exited()
            && !child.is_starting(run)
            && beat.is_some_and(|beat| beat.hangs(since))
    }

    /// Returns why one of these processes could not be started again, as far as that is known. Then
    /// it must not be ended.
    pub fn why_not_again(&self, mut processes: impl Iterator<Item = usize>) -> Option<String> {
        processes.find_map(|i| {
            let (name, path) = (self[i].name(), self[i].plan.changed_file()?.display());
            Some(format!(
                "{name} could not be started again, since {path} has changed; `gyre swap {name}` takes the new one"
            ))
        })
    }

    pub fn count_restart(&mut self, process: usize) {
        let name = self[process].name().to_owned();
        *self.restarts.entry(name).or_default() += 1;
    }

    /// Lets programs pass their trials that have worked on a pose since they took the place of
    /// others.
    pub fn pass_trials(&mut self, pose: &PoseHeader, recovery: &Recovery) {
        let on_trial = self.children.iter_mut().filter(|child| child.is_on_trial);
        for child in on_trial {
            let has_passed = match child.stage() {
                Some(hop) => recovery.has_worked(hop, pose),
                // Poses do not show the work of a follower.
                None => child.has_outlived_its_window(),
            };
            if has_passed {
                child.is_on_trial = false;
            }
        }
    }

    pub fn kill(&mut self, processes: &[usize], guardian: &Guardian) -> Result<(), SuperviseError> {
        processes.iter().for_each(|i| self[*i].kill());
        for i in processes {
            self[*i].await_end()?;
            guardian.forget(self[*i].pid());
        }
        Ok(())
    }

    /// Stops all processes, and kills those that do not exit in time. One that has more of it has
    /// that in a complete run, unless a stop is requested.
    pub fn stop(
        &mut self,
        run: &mut Run<'_>,
        ending: Option<Ending>,
    ) -> Result<(), SuperviseError> {
        self.children.iter().for_each(Child::terminate);
        let (mut since, mut kept) = (Instant::now(), kept_of_held(run.manifest()));
        let mut is_complete = matches!(ending, Some(Ending::Complete));
        while let Some(timeout) = self.longest_end(is_complete)
            && since.elapsed() < kept.map_or(timeout, |_| timeout.max(CATCH_UP))
        {
            is_complete &= !run.sleep(wake::MAX_WAIT)?;
            run.say(Event::Watched);
            let now = kept_of_held(run.manifest());
            if now > kept {
                since = Instant::now();
            }
            kept = now;
        }
        let all: Vec<usize> = (0..self.len()).collect();
        self.kill(&all, &run.guardian)
    }

    /// Returns the time to end that the processes have which have not; `None` if all have.
    fn longest_end(&mut self, is_complete: bool) -> Option<Duration> {
        let children = self.children.iter_mut();
        let living = children.filter_map(|child| (!child.has_exited()).then_some(&*child));
        let timeouts = living.map(|child| match is_complete {
            true => child.plan.end_timeout,
            false => END_TIMEOUT,
        });
        timeouts.max()
    }

    /// Checks that no process has failed at its end, for example because it cannot keep its output.
    /// Followers that were given up are left out: their end was reported when it came.
    pub fn require_good_ends(&mut self, followers: &Followers<'_>) -> Result<(), SuperviseError> {
        let children = self.children.iter_mut().enumerate();
        let mut judged = children.filter(|(i, _)| !followers.has_given_up(*i));
        let failed = judged.find_map(|(_, child)| child.permanent_failure());
        failed.map_or(Ok(()), |message| Err(SuperviseError::Process(message)))
    }
}

/// Returns the bytes of the journal while poses are held in memory, or have been until the end.
fn kept_of_held(manifest: &Manifest) -> Option<u64> {
    sink::notice(manifest)?;
    let files = fs::read_dir(manifest.out.join("journal")).into_iter();
    let files = files.flatten().flatten().flat_map(|file| file.metadata());
    Some(files.map(|file| file.len()).sum())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_written_counts_while_poses_are_held() {
        let out = tempfile::tempdir().unwrap();
        let manifest = crate::tests::manifest(out.path());
        fs::create_dir(out.path().join("journal")).unwrap();
        let kept = |name: &str| {
            fs::write(out.path().join("journal").join(name), "written").unwrap();
            kept_of_held(&manifest)
        };
        assert_eq!(kept("poses"), None);
        sink::set_notice(&manifest, "the disk is full").unwrap();
        assert_eq!([kept("poses"), kept("scans")], [Some(7), Some(14)]);
    }
}
