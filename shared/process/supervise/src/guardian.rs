//! A process that outlives a killed supervisor, to end the stages' own children, as a shell has
//! them, and to remove the run's shared memory. Each stage leads a process group; the guardian
//! reads the groups from a pipe, whose end is the end of the supervisor.

use std::{
    collections::BTreeMap,
    io::{self, PipeWriter, Read},
    os::{
        fd::{AsRawFd, BorrowedFd, RawFd},
        unix::process::CommandExt,
    },
    path::Path,
    process::{Child, Command, Stdio},
    thread,
    time::{Duration, Instant},
};

use gyre_transport::{run, wake::Signals};
use rustix::{
    io::ioctl_fionbio,
    process::{Pid, RawPid, Signal, getpid, kill_process_group},
};

use crate::{SuperviseError, end::ends_within};
use gyre_client::ProcessStat;

const STOP_TIMEOUT: Duration = Duration::from_secs(1);
const PERIOD: Duration = Duration::from_millis(10);

pub(crate) struct Guardian {
    process: Child,
    groups: Option<PipeWriter>,
}

impl Guardian {
    /// Starts the guardian of the run with this root, a process that calls [`guard`], with groups
    /// in its care. They are in the pipe before there is a guardian: the supervisor can be killed
    /// at any time.
    pub fn start(
        command: &[String],
        root: &Path,
        groups: impl IntoIterator<Item = u32>,
    ) -> Result<Self, SuperviseError> {
        let failed = |error: io::Error| {
            let command = command.join(" ");
            SuperviseError::System(format!(
                "cannot start `{command}`, which ends the children of stages if the supervisor is killed: {error}"
            ))
        };
        let (program, arguments) = command
            .split_first()
            .ok_or_else(|| failed(io::ErrorKind::InvalidInput.into()))?;
        let (messages, pipe) = io::pipe().map_err(failed)?;
        // A guardian that hangs must not make the supervisor wait.
        ioctl_fionbio(&pipe, true).map_err(|error| failed(error.into()))?;
        for group in groups {
            send(&pipe, group as RawPid);
        }
        let process = Command::new(program)
            .args(arguments)
            .env(run::ENVIRONMENT, root)
            .stdin(messages)
            .stdout(Stdio::null())
            .stderr(Stdio::null())
            // An interrupt from the terminal must not reach it.
            .process_group(0)
            .spawn()
            .map_err(failed)?;
        Ok(Self {
            process,
            groups: Some(pipe),
        })
    }

    /// Returns the pipe that a process uses to join: see [`join`].
    pub fn pipe(&self) -> Option<RawFd> {
        self.groups.as_ref().map(AsRawFd::as_raw_fd)
    }

    pub fn has_ended(&mut self) -> bool {
        self.process.try_wait().is_ok_and(|ended| ended.is_some())
    }

    /// Forgets a group: the processes are dead, and the number may be reused.
    pub fn forget(&self, group: u32) {
        if let Some(pipe) = &self.groups {
            send(pipe, -(group as RawPid));
        }
    }
}

impl Drop for Guardian {
    fn drop(&mut self) {
        self.groups = None;
        if !ends_within(&mut self.process, STOP_TIMEOUT) {
            let _ = self.process.kill();
        }
        let _ = self.process.wait();
    }
}

/// Sends a message to the guardian. Fails if somebody has killed it, which is noticed.
fn send(pipe: &PipeWriter, message: RawPid) {
    let _ = rustix::io::write(pipe, &message.to_ne_bytes());
}

/// Puts the group that this process leads into the care of the guardian. Called between fork and
/// exec, so that a stage never has unknown children.
pub(crate) fn join(pipe: RawFd) {
    // SAFETY: the supervisor keeps the pipe open while it starts a process, and the new process has
    // a copy of it.
    let pipe = unsafe { BorrowedFd::borrow_raw(pipe) };
    let _ = rustix::io::write(pipe, &getpid().as_raw_nonzero().get().to_ne_bytes());
}

/// Reads process groups until the supervisor ends, then kills those that it has left, and removes
/// the shared memory of the run with this root.
///
/// A message is a process group, or a negative one that is to be forgotten.
pub fn guard(mut messages: impl Read, root: Option<&Path>) {
    // A request to stop that reaches all processes of a service is the supervisor's alone.
    let _caught = Signals::install();
    let mut groups = BTreeMap::new();
    let mut message = [0; size_of::<RawPid>()];
    while messages.read_exact(&mut message).is_ok() {
        let group = RawPid::from_ne_bytes(message);
        match group > 0 {
            true => groups.insert(group, started(group)),
            false => groups.remove(&group.saturating_neg()),
        };
    }
    let mut killed = Vec::new();
    for (group, since) in groups {
        // A number can be reused. While a group has processes left, no other process gets its
        // number.
        let is_another = started(group).is_some_and(|now| Some(now) != since);
        if let Some(group) = Pid::from_raw(group).filter(|_| !is_another) {
            let _ = kill_process_group(group, Signal::KILL);
            killed.push(group);
        }
    }
    // Living processes could create files again.
    let deadline = Instant::now() + STOP_TIMEOUT;
    while killed.iter().any(|group| lives(*group)) && Instant::now() < deadline {
        thread::sleep(PERIOD);
    }
    if let Some(root) = root {
        run::sweep_run(root);
    }
}

/// A process that nobody waits for stays as a zombie.
fn lives(group: Pid) -> bool {
    let group = group.as_raw_pid() as u32;
    ProcessStat::all().any(|stat| stat.group == group && !stat.has_ended)
}

fn started(process: RawPid) -> Option<u64> {
    ProcessStat::of(process as u32).map(|stat| stat.started)
}

#[cfg(test)]
mod tests {
    use std::os::unix::process::ExitStatusExt;

    use super::*;

    fn sleeper() -> Child {
        let mut command = Command::new("sleep");
        command.arg("60").process_group(0).spawn().unwrap()
    }

    #[test]
    fn groups_that_are_left_at_the_end_are_killed() {
        let (mut kept, mut forgotten) = (sleeper(), sleeper());
        let (kept_id, forgotten_id) = (kept.id() as RawPid, forgotten.id() as RawPid);
        let messages = [kept_id, forgotten_id, -forgotten_id].map(RawPid::to_ne_bytes);
        guard(messages.as_flattened(), None);
        assert_eq!(kept.wait().unwrap().signal(), Some(9));
        assert!(!ends_within(&mut forgotten, Duration::from_millis(50)));
        forgotten.kill().unwrap();
        forgotten.wait().unwrap();
    }
}
