//! The processes of a run, and the stages that they belong to.
//!
//! The supervisor knows its stages whatever their programs are called. Each leads a process group,
//! with the processes that it starts, as those behind a shell.

use std::{
    collections::BTreeMap,
    fs,
    path::{Path, PathBuf},
};

use gyre_stage::control::Control;
use gyre_supervise::ProcessStat;

/// A living process of a run.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Member {
    /// The stage, the follower, `supervisor`, `guardian` or `other`.
    pub name: String,
    /// The process.
    pub pid: u32,
}

/// The processes of a run.
#[derive(Debug)]
pub struct Members {
    supervisor: u32,
    out: PathBuf,
    /// The names of the process groups that have been seen.
    names: BTreeMap<u32, String>,
}

impl Members {
    /// The processes of the run that this process supervises, and that writes to `out`.
    pub fn of(supervisor: u32, out: &Path) -> Self {
        Self {
            supervisor,
            out: out.to_owned(),
            names: BTreeMap::new(),
        }
    }

    /// Returns the living processes.
    pub fn living(&mut self) -> Vec<Member> {
        let rows = rows();
        self.learn(&rows);
        members(&rows, self.supervisor, &self.names)
    }

    /// Returns the process group of a stage or follower as of now.
    pub fn group_of(&mut self, name: &str) -> Option<u32> {
        let rows = rows();
        self.learn(&rows);
        let mut children = rows.iter().filter(|row| row.parent == self.supervisor);
        let is_it =
            |row: &&ProcessStat| self.names.get(&row.pid).is_some_and(|known| known == name);
        children.find(is_it).map(|row| row.group)
    }

    /// Asks the supervisor for the names of its processes if there is one that has none.
    fn learn(&mut self, rows: &[ProcessStat]) {
        let children = || rows.iter().filter(|row| row.parent == self.supervisor);
        if children().all(|row| self.names.contains_key(&row.pid)) {
            return;
        }
        // It may be ending.
        let status = Control::of(&self.out).and_then(|run| run.status());
        let processes = status.into_iter().flat_map(|status| status.processes);
        let mut names: BTreeMap<_, _> = processes.map(|it| (it.pid, it.name)).collect();
        let unnamed = children().filter(|row| !names.contains_key(&row.pid));
        let guardians: Vec<_> = unnamed.filter(|row| is_guardian(row.pid)).collect();
        names.extend(guardians.iter().map(|row| (row.pid, "guardian".to_owned())));
        self.names.extend(names);
    }
}

/// Returns the supervisor, its children, and all that are in their groups.
fn members(rows: &[ProcessStat], supervisor: u32, names: &BTreeMap<u32, String>) -> Vec<Member> {
    let children = rows.iter().filter(|row| row.parent == supervisor);
    let name = |pid: u32| names.get(&pid).map_or("other", String::as_str);
    let leaders: BTreeMap<u32, &str> = children.map(|row| (row.pid, name(row.pid))).collect();
    let named = rows.iter().filter_map(|row| {
        let name = match row.pid == supervisor {
            true => "supervisor",
            false => leaders.get(&row.pid).or_else(|| leaders.get(&row.group))?,
        };
        Some(Member {
            name: name.to_owned(),
            pid: row.pid,
        })
    });
    named.collect()
}

/// The living processes of the machine.
fn rows() -> Vec<ProcessStat> {
    ProcessStat::all().filter(|it| !it.has_ended).collect()
}

/// `gyre guard`, which no stage is.
fn is_guardian(pid: u32) -> bool {
    let line = fs::read_to_string(format!("/proc/{pid}/cmdline"));
    line.is_ok_and(|line| line.trim_end_matches('\0').ends_with("\0guard"))
}

#[cfg(test)]
mod tests {
    use super::*;

    const SUPERVISOR: u32 = 10;

    fn row(pid: u32, parent: u32, group: u32) -> ProcessStat {
        ProcessStat {
            pid,
            parent,
            group,
            ..ProcessStat::default()
        }
    }

    #[test]
    fn what_a_stage_has_started_belongs_to_it_also_when_its_parent_has_ended() {
        let rows = [
            row(1, 0, 1),
            row(SUPERVISOR, 1, 1),
            // A shell, its child, a grandchild whose parent has ended, and one that nobody knows
            // yet.
            row(20, SUPERVISOR, 20),
            row(21, 20, 20),
            row(22, 1, 20),
            row(30, SUPERVISOR, 30),
            // Of the terminal of the supervisor, and of another run.
            row(40, 1, 1),
            row(51, 50, 51),
        ];
        let names = [(20, "masking".to_owned())].into();
        let members = members(&rows, SUPERVISOR, &names);
        let named: Vec<_> = members
            .iter()
            .map(|it| (it.pid, it.name.as_str()))
            .collect();
        let masking = [(20, "masking"), (21, "masking"), (22, "masking")];
        let expected = [&[(10, "supervisor")][..], &masking, &[(30, "other")]].concat();
        assert_eq!(named, expected);
    }
}
