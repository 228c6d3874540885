//! The roles of a run's processes: which of them a restart concerns. Processes are indices into the
//! plan's stages. A swap does not change their roles.

use gyre_messages::{FollowerId, StageId};

use crate::Plan;

impl Plan {
    pub(crate) fn name(&self, process: usize) -> &str {
        &self.stages[process].name
    }

    pub(crate) fn follows(&self, process: usize) -> bool {
        FollowerId::by_name(self.name(process)).is_some()
    }

    pub(crate) fn named(&self, name: &str) -> Option<usize> {
        self.stages.iter().position(|plan| plan.name == name)
    }

    pub(crate) fn names(&self) -> impl Iterator<Item = &str> {
        self.stages.iter().map(|plan| plan.name.as_str())
    }

    pub(crate) fn in_stream(&self) -> impl Iterator<Item = usize> {
        (0..self.stages.len()).filter(move |process| !self.follows(*process))
    }

    pub(crate) fn followers(&self) -> impl Iterator<Item = usize> {
        (0..self.stages.len()).filter(move |process| self.follows(*process))
    }

    pub(crate) fn sources(&self) -> Vec<usize> {
        let is_source = |name| StageId::by_name(name) == Some(StageId::RadarReplay);
        let all = 0..self.stages.len();
        all.filter(|process| is_source(self.name(*process)))
            .collect()
    }

    /// Returns all stages except those that are alive and outlive restarts.
    pub(crate) fn all_but_survivors(&self, dead: &[usize]) -> Vec<usize> {
        let survives = |i: &usize| self.stages[*i].outlives_restarts && !dead.contains(i);
        self.in_stream().filter(|i| !survives(i)).collect()
    }

    /// Returns whether the restart of a process alone does not recover its state.
    pub(crate) fn restarts_all(&self, process: usize) -> bool {
        self.stages[process].restarts_all
    }

    pub(crate) fn restarted_with(&self, process: usize) -> Vec<usize> {
        match self.restarts_all(process) {
            true => self.all_but_survivors(&[process]),
            false => vec![process],
        }
    }
}
