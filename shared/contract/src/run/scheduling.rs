//! The scheduling of a process: its priority, and the processors that it may use.

use rustix::thread::CpuSet;
use serde::{Deserialize, Serialize};

/// The scheduling of a process. A key that is left out keeps the inherited setting.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Scheduling {
    /// Niceness, -20 (first) to 19 (last). Below 0 it needs CAP_SYS_NICE, or `ulimit -e`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub nice: Option<i32>,
    /// Priority of the real-time policy SCHED_FIFO, 1 to 99: it runs before all processes without
    /// one. It needs CAP_SYS_NICE, or `ulimit -r`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub realtime_priority: Option<u8>,
    /// Processors that it may use, from 0. Default: all.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub cpus: Vec<usize>,
    /// True to keep its memory from being paged out. It needs CAP_IPC_LOCK, or `ulimit -l`. A
    /// replacement has to do that itself.
    #[serde(skip_serializing_if = "std::ops::Not::not")]
    pub lock_memory: bool,
}

impl Scheduling {
    /// Returns this one, with the keys of `other` that it leaves out.
    #[must_use]
    pub fn or(&self, other: &Self) -> Self {
        Self {
            nice: self.nice.or(other.nice),
            realtime_priority: self.realtime_priority.or(other.realtime_priority),
            cpus: match self.cpus.is_empty() {
                true => other.cpus.clone(),
                false => self.cpus.clone(),
            },
            lock_memory: self.lock_memory || other.lock_memory,
        }
    }

    /// Checks the ranges of the values.
    pub fn validate(&self) -> Result<(), String> {
        if self.nice.is_some_and(|nice| !(-20..=19).contains(&nice)) {
            return Err("scheduling.nice must be from -20 to 19".to_owned());
        }
        let is_priority = |priority| (1..=99).contains(&priority);
        if self.realtime_priority.is_some_and(|p| !is_priority(p)) {
            return Err("scheduling.realtime_priority must be from 1 to 99".to_owned());
        }
        if self.cpus.iter().any(|cpu| *cpu >= CpuSet::MAX_CPU) {
            let last = CpuSet::MAX_CPU - 1;
            return Err(format!("scheduling.cpus must be from 0 to {last}"));
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_stage_s_own_keys_go_before_those_of_the_run() {
        let run = Scheduling {
            nice: Some(-5),
            cpus: vec![0, 1],
            ..Scheduling::default()
        };
        let own = Scheduling {
            nice: Some(0),
            ..Scheduling::default()
        };
        let both = own.or(&run);
        assert_eq!((both.nice, both.cpus), (Some(0), vec![0, 1]));
    }

    #[test]
    fn values_out_of_range_are_refused() {
        let with = |nice, realtime_priority, cpus: &[usize]| Scheduling {
            nice,
            realtime_priority,
            cpus: cpus.to_vec(),
            lock_memory: false,
        };
        assert!(with(Some(-20), Some(99), &[0]).validate().is_ok());
        for wrong in [
            with(Some(-21), None, &[]),
            with(None, Some(0), &[]),
            with(None, None, &[CpuSet::MAX_CPU]),
        ] {
            assert!(wrong.validate().is_err(), "{wrong:?}");
        }
    }
}
