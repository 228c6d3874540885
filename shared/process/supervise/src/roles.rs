//! The roles of a run's processes, by the plan: which of them a restart concerns. Processes are
//! indices into the plan's stages.

use gyre_messages::{FollowerId, StageId};

use crate::{Plan, StagePlan};

/// The roles of all processes. A swap does not change them.
#[derive(Clone, Copy)]
pub(crate) struct Roles<'a>(&'a [StagePlan]);

impl<'a> Roles<'a> {
    pub fn of(plan: &'a Plan) -> Self {
        Self(&plan.stages)
    }

    pub fn name(self, process: usize) -> &'a str {
        &self.0[process].name
    }

    pub fn follows(self, process: usize) -> bool {
        FollowerId::by_name(self.name(process)).is_some()
    }

    pub fn named(self, name: &str) -> Option<usize> {
        self.0.iter().position(|plan| plan.name == name)
    }

    pub fn names(self) -> impl Iterator<Item = &'a str> {
        self.0.iter().map(|plan| plan.name.as_str())
    }

    pub fn stages(self) -> impl Iterator<Item = usize> {
        (0..self.0.len()).filter(move |process| !self.follows(*process))
    }

    pub fn followers(self) -> impl Iterator<Item = usize> {
        (0..self.0.len()).filter(move |process| self.follows(*process))
    }

    pub fn sources(self) -> Vec<usize> {
        let is_source = |name| StageId::by_name(name) == Some(StageId::RadarReplay);
        let all = 0..self.0.len();
        all.filter(|process| is_source(self.name(*process)))
            .collect()
    }

    /// Returns all stages except those that are alive and outlive restarts.
    pub fn all_but_survivors(self, dead: &[usize]) -> Vec<usize> {
        let survives = |i: &usize| self.0[*i].outlives_restarts && !dead.contains(i);
        self.stages().filter(|i| !survives(i)).collect()
    }

    /// Returns whether the restart of a process alone does not recover its state.
    pub fn restarts_all(self, process: usize) -> bool {
        self.0[process].restarts_all
    }

    pub fn restarted_with(self, process: usize) -> Vec<usize> {
        match self.restarts_all(process) {
            true => self.all_but_survivors(&[process]),
            false => vec![process],
        }
    }
}
