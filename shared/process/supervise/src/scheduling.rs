//! Applies the scheduling of a process: its priority, and the processors that it may use.

use std::io;

use gyre_contract::run::Scheduling;
use rustix::{
    process::setpriority_process,
    thread::{CpuSet, sched_setaffinity},
};

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

/// Applies it to this process between fork and exec, and so to all that it will start. It only
/// calls the system, and allocates nothing. The error has the place of the refused key among
/// [`keys`].
pub(super) fn apply(scheduling: &Scheduling) -> Result<(), (u8, io::Error)> {
    if !scheduling.cpus.is_empty() {
        let mut set = CpuSet::new();
        scheduling.cpus.iter().for_each(|cpu| set.set(*cpu));
        sched_setaffinity(None, &set).map_err(|error| (0_u8, error.into()))?;
    }
    if let Some(nice) = scheduling.nice {
        setpriority_process(None, nice).map_err(|error| (1_u8, error.into()))?;
    }
    if let Some(priority) = scheduling.realtime_priority {
        set_realtime(priority).map_err(|error| (2_u8, error))?;
    }
    Ok(())
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
