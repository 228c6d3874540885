//! Starts the processes of stages.

use std::{
    io::{self, PipeWriter, Read},
    os::unix::process::CommandExt,
    process::{Child, Command, Stdio},
    time::Duration,
};

use gyre_transport::{Manifest, RunError, run, wake::Signals};
use rustix::process::{Signal, getpid, getppid, set_parent_process_death_signal};

use crate::{
    StagePlan, SuperviseError,
    guardian::{self, Guardian},
    scheduling,
};

/// Pauses after a failure to start a process for want of processes or memory; the sum is the time
/// for which it is tried.
const PAUSES_MS: [u64; 8] = [20, 50, 100, 200, 500, 1000, 2000, 4000];

pub(crate) struct Starter<'a> {
    pub manifest: &'a Manifest,
    pub signals: &'a Signals,
    pub guardian: &'a Guardian,
}

impl Starter<'_> {
    /// One that `stands_by`, since another process has its place, does so until its standard input
    /// ends (see [`run::STANDBY`]).
    pub fn start(
        &self,
        plan: &StagePlan,
        log: &PipeWriter,
        stands_by: bool,
    ) -> Result<Child, SuperviseError> {
        let (stage, program) = (&plan.name, plan.command.join(" "));
        let failed = |source: io::Error| {
            SuperviseError::Process(format!(
                "cannot start {stage} with `{program}`: {source}; see [stages.{stage}] command in the configuration"
            ))
        };
        let (mut refused, refusals) = io::pipe().map_err(failed)?;
        let mut command = self.command(plan, log, refusals).map_err(failed)?;
        if let Some(directory) = &plan.directory {
            command.current_dir(directory);
        }
        if stands_by {
            command.env(run::STANDBY, "1").stdin(Stdio::piped());
        }
        let pause = |pause| self.signals.sleep(pause);
        let started = with_patience(|| command.spawn(), pause)?;
        // With it the pipe's other end is closed.
        drop(command);
        let mut key = [0];
        match started {
            Err(source) if refused.read(&mut key).is_ok_and(|length| length > 0) => {
                let keys = scheduling::keys(&plan.scheduling);
                let what = &keys[usize::from(key[0]).min(keys.len() - 1)];
                Err(SuperviseError::Process(format!(
                    "cannot run {stage} with {what}: {source}; see scheduling in [run] and [stages.{stage}] of the configuration"
                )))
            }
            started => started.map_err(failed),
        }
    }

    /// It writes to `refusals` which key of its scheduling the system refuses.
    fn command(
        &self,
        plan: &StagePlan,
        log: &PipeWriter,
        refusals: PipeWriter,
    ) -> io::Result<Command> {
        let (program, arguments) = plan
            .command
            .split_first()
            .ok_or_else(|| io::Error::new(io::ErrorKind::InvalidInput, "it is empty"))?;
        let mut command = Command::new(program);
        command
            .args(arguments)
            .env(run::ENVIRONMENT, &self.manifest.root)
            .stdin(Stdio::null())
            .stdout(log.try_clone()?)
            .stderr(log.try_clone()?)
            // A process group of its own: an interrupt from the terminal reaches only the
            // supervisor, which then stops each stage.
            .process_group(0);
        let (supervisor, guardian) = (getpid(), self.guardian.pipe());
        let scheduling = plan.scheduling.clone();
        let prepare = move || {
            set_parent_process_death_signal(Some(Signal::KILL))?;
            guardian.into_iter().for_each(guardian::join);
            if let Err((key, error)) = scheduling::apply(&scheduling) {
                let _ = rustix::io::write(&refusals, &[key]);
                return Err(error);
            }
            match getppid() == Some(supervisor) {
                true => Ok(()),
                false => Err(io::Error::other("the supervisor has died")),
            }
        };
        // SAFETY: between fork and exec there are only system calls; nothing is allocated unless
        // the supervisor is dead.
        unsafe { command.pre_exec(prepare) };
        Ok(command)
    }
}

/// A request to stop ends the attempts.
fn with_patience<T>(
    mut start: impl FnMut() -> io::Result<T>,
    mut pause: impl FnMut(Duration) -> Result<bool, RunError>,
) -> Result<io::Result<T>, RunError> {
    for ms in PAUSES_MS {
        match start() {
            Err(error) if is_temporary(error.kind()) => {}
            started => return Ok(started),
        }
        if pause(Duration::from_millis(ms))? {
            break;
        }
    }
    Ok(start())
}

fn is_temporary(error: io::ErrorKind) -> bool {
    matches!(
        error,
        // No room for a process, no memory, and a program that is just being written.
        io::ErrorKind::WouldBlock | io::ErrorKind::OutOfMemory | io::ErrorKind::ExecutableFileBusy
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Starts with these results one after the other; returns the last one and the number of
    /// attempts.
    fn started(stop: bool, results: &[io::Result<()>]) -> (Option<io::ErrorKind>, usize) {
        let mut attempts = 0;
        let start = || {
            let result = &results[attempts.min(results.len() - 1)];
            attempts += 1;
            result.as_ref().copied().map_err(|e| e.kind().into())
        };
        let result = with_patience(start, |_| Ok(stop)).unwrap();
        (result.err().map(|error| error.kind()), attempts)
    }

    #[test]
    fn a_process_that_finds_no_room_is_started_later_unless_a_stop_is_requested() {
        let (busy, missing) = (io::ErrorKind::WouldBlock, io::ErrorKind::NotFound);
        let busy = || Err(busy.into());
        assert_eq!(started(false, &[busy(), busy(), Ok(())]), (None, 3));
        let (error, attempts) = started(false, &[busy()]);
        assert_eq!((error, attempts), (Some(io::ErrorKind::WouldBlock), 9));
        assert_eq!(started(false, &[Err(missing.into())]), (Some(missing), 1));
        assert_eq!(started(true, &[busy()]).1, 2);
    }
}
