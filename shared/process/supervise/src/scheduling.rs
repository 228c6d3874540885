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

/// The keys that the system can refuse, with their values, for a sentence.
pub(super) fn keys(scheduling: &Scheduling) -> [String; 3] {
    let nice = scheduling.nice.unwrap_or_default();
    let priority = scheduling.realtime_priority.unwrap_or_default();
    [
        format!("cpus = {:?}", scheduling.cpus),
        format!("nice = {nice}"),
        format!("realtime_priority = {priority}"),
    ]
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
    /// The error has the place of the refused key among [`keys`].
    pub fn apply(&self) -> Result<(), (u8, io::Error)> {
        if let Some(set) = &self.cpus {
            sched_setaffinity(None, set).map_err(|error| (0_u8, error.into()))?;
        }
        if let Some(nice) = self.nice {
            setpriority_process(None, nice).map_err(|error| (1_u8, error.into()))?;
        }
        if let Some(priority) = self.realtime_priority {
            set_realtime(priority).map_err(|error| (2_u8, error))?;
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
