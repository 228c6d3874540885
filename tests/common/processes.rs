//! Looking at processes through /proc.

use std::{
    collections::BTreeMap,
    ffi::OsStr,
    fs,
    os::unix::ffi::OsStrExt,
    path::{Path, PathBuf},
    time::Duration,
};

use gyre_messages::{FollowerId, StageId};
use rustix::process::{Signal, kill_process};

/// A process id.
pub type Pid = u32;

/// Sends a signal. That the process is gone already is no error.
pub fn send(pid: Pid, signal: Signal) {
    if let Some(pid) = rustix::process::Pid::from_raw(pid as i32) {
        let _ = kill_process(pid, signal);
    }
}

/// The time that a process has spent computing.
pub fn cpu_time(pid: Pid) -> Duration {
    let stat = fs::read_to_string(format!("/proc/{pid}/stat")).unwrap();
    // After the name in brackets: state, ppid, ...; utime and stime are the 14th and 15th of all,
    // in hundredths of a second.
    let fields: Vec<&str> = stat.rsplit_once(") ").unwrap().1.split(' ').collect();
    let ticks: u64 = fields[11].parse::<u64>().unwrap() + fields[12].parse::<u64>().unwrap();
    Duration::from_millis(ticks * 10)
}

/// The living stages and followers among a supervisor's children, by name.
pub fn stages_of(supervisor: Pid) -> BTreeMap<String, Pid> {
    let ours = |pid: &Pid| {
        parent_and_state(*pid).is_some_and(|(parent, state)| parent == supervisor && state != 'Z')
    };
    pids()
        .filter(ours)
        .filter_map(|pid| Some((stage_name(pid)?, pid)))
        .collect()
}

/// The guardian among a supervisor's children.
pub fn guardian_of(supervisor: Pid) -> Option<Pid> {
    let is_guardian = |pid: &Pid| {
        let line = fs::read(format!("/proc/{pid}/cmdline")).unwrap_or_default();
        parent_and_state(*pid).is_some_and(|(parent, state)| parent == supervisor && state != 'Z')
            && line.ends_with(b"\0guard\0")
    };
    pids().find(is_guardian)
}

/// Processes whose environment names the run at `root`.
pub fn of_run(root: &Path) -> Vec<Pid> {
    pids()
        .filter(|pid| run_of(*pid).is_some_and(|run| run == root))
        .collect()
}

/// The root of the run that the environment of a process names.
pub fn run_of(pid: Pid) -> Option<PathBuf> {
    let environment = fs::read(format!("/proc/{pid}/environ")).ok()?;
    let mut variables = environment.split(|byte| *byte == 0);
    let run = variables.find_map(|variable| variable.strip_prefix(b"GYRE_RUN="))?;
    Some(PathBuf::from(OsStr::from_bytes(run)))
}

/// A living child of a supervisor with this word in its command.
pub fn child_with(supervisor: Pid, word: &str) -> Option<Pid> {
    let is_it = |pid: &Pid| {
        let line = fs::read(format!("/proc/{pid}/cmdline")).unwrap_or_default();
        parent_and_state(*pid).is_some_and(|(parent, state)| parent == supervisor && state != 'Z')
            && line
                .split(|byte| *byte == 0)
                .any(|part| part == word.as_bytes())
    };
    pids().find(is_it)
}

fn pids() -> impl Iterator<Item = Pid> {
    let entries = fs::read_dir("/proc").unwrap();
    entries.filter_map(|entry| entry.ok()?.file_name().to_str()?.parse().ok())
}

/// The parent of a process.
pub fn parent_of(pid: Pid) -> Option<Pid> {
    parent_and_state(pid).map(|(parent, _)| parent)
}

fn parent_and_state(pid: Pid) -> Option<(Pid, char)> {
    let stat = fs::read_to_string(format!("/proc/{pid}/stat")).ok()?;
    let mut fields = stat.rsplit_once(") ")?.1.split(' ');
    let state = fields.next()?.chars().next()?;
    Some((fields.next()?.parse().ok()?, state))
}

/// `gyre stage NAME`, or a script that is named after the stage.
fn stage_name(pid: Pid) -> Option<String> {
    let line = fs::read(format!("/proc/{pid}/cmdline")).ok()?;
    let last = line
        .split(|byte| *byte == 0)
        .rfind(|word| !word.is_empty())?;
    let path = PathBuf::from(String::from_utf8_lossy(last).into_owned());
    let name = path.file_stem()?.to_string_lossy().into_owned();
    let is_known = StageId::by_name(&name).is_some() || FollowerId::by_name(&name).is_some();
    is_known.then_some(name)
}
