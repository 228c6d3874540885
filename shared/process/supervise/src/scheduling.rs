//! Applies the scheduling of a process: its priority, and the processors that it may use.

use std::io;

use gyre_run::Scheduling;
use rustix::{
    process::setpriority_process,
    thread::{CpuSet, sched_setaffinity},
};

/// Returns the settings that a new process can apply to itself between fork and exec.
pub(super) fn prepare(scheduling: &Scheduling) -> Prepared {
    let mut set = CpuSet::new();
    scheduling.cpus.iter().for_each(|cpu| set.set(*cpu));
    Prepared {
        cpus: (!scheduling.cpus.is_empty()).then_some(set),
        nice: scheduling.nice,
        realtime_priority: scheduling.realtime_priority,
    }
}

pub(super) fn describe(scheduling: &Scheduling, key: Key) -> String {
    match key {
        Key::Cpus => format!("cpus = {:?}", scheduling.cpus),
        Key::Nice => format!("nice = {}", scheduling.nice.unwrap_or_default()),
        Key::RealtimePriority => {
            let priority = scheduling.realtime_priority.unwrap_or_default();
            format!("realtime_priority = {priority}")
        }
    }
}

/// A key that the system can refuse.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Key {
    Cpus,
    Nice,
    RealtimePriority,
}

impl Key {
    pub const ALL: [Self; 3] = [Self::Cpus, Self::Nice, Self::RealtimePriority];
}

/// A [`Scheduling`] without anything that has to be allocated.
#[derive(Clone, Copy)]
pub(crate) struct Prepared {
    cpus: Option<CpuSet>,
    nice: Option<i32>,
    realtime_priority: Option<u8>,
}

impl Prepared {
    /// Applies it to this process, and so to all that it will start. It only calls the system.
    pub fn apply(&self) -> Result<(), (Key, io::Error)> {
        if let Some(set) = &self.cpus {
            sched_setaffinity(None, set).map_err(|error| (Key::Cpus, error.into()))?;
        }
        if let Some(nice) = self.nice {
            setpriority_process(None, nice).map_err(|error| (Key::Nice, error.into()))?;
        }
        if let Some(priority) = self.realtime_priority {
            set_realtime(priority).map_err(|error| (Key::RealtimePriority, error))?;
        }
        Ok(())
    }
}

fn set_realtime(priority: u8) -> io::Result<()> {
    let parameters = libc::sched_param {
        sched_priority: i32::from(priority),
    };
    // SAFETY: the kernel reads the parameters during the call only.
    match unsafe { libc::sched_setscheduler(0, libc::SCHED_FIFO, &raw const parameters) } {
        0 => Ok(()),
        _ => Err(io::Error::last_os_error()),
    }
}
