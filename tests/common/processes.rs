//! Looking at processes through /proc.

use std::{
    collections::BTreeMap,
    ffi::OsStr,
    fs,
    os::unix::ffi::OsStrExt,
    path::{Path, PathBuf},
};

use gyre_client::ProcessStat;
use gyre_contract::{FollowerId, StageId};
use rustix::process::{Signal, kill_process};

pub type Pid = u32;

/// Sends a signal. That the process is gone already is no error.
pub fn send(pid: Pid, signal: Signal) {
    if let Some(pid) = rustix::process::Pid::from_raw(pid as i32) {
        let _ = kill_process(pid, signal);
    }
}

/// The living stages and followers among a supervisor's children, by name.
pub fn stages_of(supervisor: Pid) -> BTreeMap<String, Pid> {
    children_of(supervisor)
        .filter_map(|pid| Some((stage_name(pid)?, pid)))
        .collect()
}

pub fn of_run(root: &Path) -> Vec<Pid> {
    let of_run = |pid: &Pid| run_of(*pid).is_some_and(|run| run == root);
    ProcessStat::all().map(|it| it.pid).filter(of_run).collect()
}

/// The root of the run that the environment of a process names.
pub fn run_of(pid: Pid) -> Option<PathBuf> {
    let environment = fs::read(format!("/proc/{pid}/environ")).ok()?;
    let mut variables = environment.split(|byte| *byte == 0);
    let run = variables.find_map(|variable| variable.strip_prefix(b"GYRE_RUN="))?;
    Some(PathBuf::from(OsStr::from_bytes(run)))
}

pub fn child_with(supervisor: Pid, word: &str) -> Option<Pid> {
    children_of(supervisor).find(|pid| words(*pid).iter().any(|it| it == word))
}

pub fn is_alive(pid: Pid) -> bool {
    ProcessStat::of(pid).is_some_and(|process| !process.has_ended)
}

pub fn parent_of(pid: Pid) -> Option<Pid> {
    stat(pid)?[1].parse().ok()
}

fn children_of(supervisor: Pid) -> impl Iterator<Item = Pid> {
    let living = ProcessStat::all().filter(|process| !process.has_ended);
    let pids = living.map(|process| process.pid);
    pids.filter(move |pid| parent_of(*pid) == Some(supervisor))
}

/// The fields of a process behind its name: state, parent and others.
pub fn stat(pid: Pid) -> Option<Vec<String>> {
    let stat = fs::read_to_string(format!("/proc/{pid}/stat")).ok()?;
    let (_, fields) = stat.rsplit_once(") ")?;
    Some(fields.split(' ').map(str::to_owned).collect())
}

/// What the system says of a process in the line of `/proc/PID/status` with this name.
pub fn status(pid: Pid, name: &str) -> Option<String> {
    let status = fs::read_to_string(format!("/proc/{pid}/status")).ok()?;
    let mut lines = status.lines().filter_map(|line| line.split_once(':'));
    let (_, value) = lines.find(|(named, _)| *named == name)?;
    Some(value.trim().to_owned())
}

fn words(pid: Pid) -> Vec<String> {
    let line = fs::read(format!("/proc/{pid}/cmdline")).unwrap_or_default();
    let line = String::from_utf8_lossy(&line);
    let words = line.split('\0').filter(|word| !word.is_empty());
    words.map(str::to_owned).collect()
}

/// `gyre stage NAME`, or a script that is named after the stage.
fn stage_name(pid: Pid) -> Option<String> {
    let last = words(pid).pop()?;
    let name = Path::new(&last).file_stem()?.to_str()?.to_owned();
    let is_known = StageId::by_name(&name).is_some() || FollowerId::by_name(&name).is_some();
    is_known.then_some(name)
}
