//! One process of a run.

use std::{
    collections::VecDeque,
    fs::{File, OpenOptions},
    io::{self, Read, Seek, SeekFrom},
    os::unix::process::{CommandExt, ExitStatusExt},
    process::{Command, ExitStatus, Stdio},
    time::{Duration, Instant},
};

use rustix::process::{
    Pid, Signal, getpid, getppid, kill_process_group, set_parent_process_death_signal,
};

use super::{StagePlan, SuperviseError};
use crate::{Manifest, StageError, run};

/// How a process died.
#[derive(Clone, Debug)]
pub struct Death {
    /// By a signal; else it ended by itself.
    pub killed: bool,
    /// In words.
    pub how: String,
    /// Its exit code, if it ended by itself.
    pub code: Option<i32>,
    /// The last line that it wrote to its standard error.
    pub last_words: Option<String>,
}

pub(super) struct Child {
    plan: StagePlan,
    process: std::process::Child,
    status: Option<ExitStatus>,
    deaths: VecDeque<Instant>,
    /// The newest pose when it was last started again.
    pose_at_restart: Option<Option<u64>>,
    said_before: u64,
    log: File,
}

impl Child {
    pub(super) fn spawn(plan: &StagePlan, manifest: &Manifest) -> Result<Self, SuperviseError> {
        let log = open_log(plan, manifest)?;
        let said_before = log.metadata().map_or(0, |log| log.len());
        let process = start(plan, manifest, &log)?;
        Ok(Self {
            plan: plan.clone(),
            process,
            status: None,
            deaths: VecDeque::new(),
            pose_at_restart: None,
            said_before,
            log,
        })
    }

    pub(super) fn respawn(
        &mut self,
        manifest: &Manifest,
        newest_pose: Option<u64>,
    ) -> Result<(), SuperviseError> {
        self.process = start(&self.plan, manifest, &self.log)?;
        self.status = None;
        self.pose_at_restart = Some(newest_pose);
        Ok(())
    }

    pub(super) fn plan(&self) -> &StagePlan {
        &self.plan
    }

    pub(super) fn name(&self) -> &str {
        &self.plan.name
    }

    pub(super) fn pid(&self) -> u32 {
        self.process.id()
    }

    pub(super) fn backoff(&self) -> Duration {
        Duration::from_millis(self.plan.restart.backoff_ms)
    }

    /// Whether it has died before and no pose has come since.
    pub(super) fn died_without_progress(&self, newest_pose: Option<u64>) -> bool {
        self.pose_at_restart == Some(newest_pose)
    }

    pub(super) fn has_ended(&mut self) -> bool {
        if self.status.is_none() {
            self.status = self.process.try_wait().ok().flatten();
            if self.status.is_some() {
                // What it has started, where its command is a shell for instance, ends with it.
                self.signal(Signal::KILL);
            }
        }
        self.status.is_some()
    }

    /// Counts the death against the policy.
    pub(super) fn may_restart(&mut self, death: &Death) -> Result<(), SuperviseError> {
        if death.code == Some(i32::from(StageError::HOPELESS)) {
            let words = death
                .last_words
                .clone()
                .unwrap_or_else(|| format!("{}: {}", self.name(), death.how));
            return Err(SuperviseError::Hopeless { words });
        }
        let policy = self.plan.restart;
        let window = Duration::try_from_secs_f64(policy.window_s).unwrap_or(Duration::MAX);
        self.deaths.push_back(Instant::now());
        self.deaths.retain(|death| death.elapsed() <= window);
        if self.deaths.len() <= policy.limit {
            return Ok(());
        }
        Err(SuperviseError::TooManyDeaths {
            stage: self.name().to_owned(),
            times: self.deaths.len(),
            window_s: policy.window_s,
            how: death.how.clone(),
            words: death
                .last_words
                .as_ref()
                .map_or(String::new(), |words| format!(" ({words})")),
        })
    }

    pub(super) fn death(&mut self) -> Death {
        let status = self.status.unwrap_or_default();
        let how = match (status.signal(), status.code()) {
            (Some(signal), _) => format!("signal {signal}"),
            (None, code) => format!("exit code {}", code.unwrap_or_default()),
        };
        Death {
            killed: status.signal().is_some(),
            how,
            code: status.code(),
            last_words: self.last_words(),
        }
    }

    pub(super) fn ask_to_end(&self) {
        if self.status.is_none() {
            self.signal(Signal::TERM);
        }
    }

    pub(super) fn kill(&mut self) {
        if self.status.is_none() {
            self.signal(Signal::KILL);
            self.status = self.process.wait().ok();
        }
    }

    /// Sends a signal to its process group.
    fn signal(&self, signal: Signal) {
        if let Some(group) = Pid::from_raw(self.process.id() as i32) {
            // All may have ended this moment: then there is nobody to tell.
            let _ = kill_process_group(group, signal);
        }
    }

    fn last_words(&mut self) -> Option<String> {
        let mut said = String::new();
        self.log.seek(SeekFrom::Start(self.said_before)).ok()?;
        let read = self.log.read_to_string(&mut said).ok()?;
        self.said_before += read as u64;
        said.lines()
            .rev()
            .find(|line| !line.trim().is_empty())
            .map(str::to_owned)
    }
}

impl Drop for Child {
    fn drop(&mut self) {
        self.kill();
    }
}

/// What it writes to its standard output and error: `<out>/log/<stage>.txt`.
fn open_log(plan: &StagePlan, manifest: &Manifest) -> Result<File, StageError> {
    let path = manifest.out.join("log").join(format!("{}.txt", plan.name));
    let opened = OpenOptions::new()
        .create(true)
        .append(true)
        .read(true)
        .open(&path);
    opened.map_err(|source| StageError::File { path, source })
}

fn start(
    plan: &StagePlan,
    manifest: &Manifest,
    log: &File,
) -> Result<std::process::Child, SuperviseError> {
    let failed = |source| SuperviseError::Spawn {
        stage: plan.name.clone(),
        command: plan.command.join(" "),
        source,
    };
    let (program, arguments) = plan
        .command
        .split_first()
        .ok_or_else(|| failed(io::Error::new(io::ErrorKind::InvalidInput, "it is empty")))?;
    let mut command = Command::new(program);
    command
        .args(arguments)
        .env(run::ENVIRONMENT, &manifest.root)
        .stdin(Stdio::null())
        .stdout(log.try_clone().map_err(failed)?)
        .stderr(log.try_clone().map_err(failed)?)
        // A group of its own: the terminal's interrupt reaches the supervisor alone, which then asks each stage to end.
        .process_group(0);
    let supervisor = getpid();
    let die_with_the_supervisor = move || {
        set_parent_process_death_signal(Some(Signal::KILL))?;
        match getppid() == Some(supervisor) {
            true => Ok(()),
            false => Err(io::Error::other("the supervisor has died")),
        }
    };
    // SAFETY: between fork and exec only two system calls are made; nothing is allocated unless the supervisor is dead.
    unsafe { command.pre_exec(die_with_the_supervisor) };
    command.spawn().map_err(failed)
}
