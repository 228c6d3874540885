//! One process of a run.

use std::{
    collections::VecDeque,
    fmt,
    os::unix::process::ExitStatusExt,
    process::ExitStatus,
    time::{Duration, Instant},
};

use gyre_contract::{
    StageId,
    control::{Activity, ProcessStatus},
};
use gyre_transport::{
    Manifest, RunError,
    heartbeat::{self, Heartbeat},
    run::SHARED_MEMORY,
};
use rustix::process::{Pid, Signal, kill_process_group};

use crate::{StagePlan, SuperviseError, end::ends_within, log::Log, run::Run, start::Starter};

/// A stage may restart as often in this time as its limit allows.
const RESTART_WINDOW: Duration = Duration::from_secs(30);
/// Delay before the restart of a process that exited. A killed one is restarted at once.
pub const RESTART_BACKOFF: Duration = Duration::from_millis(100);
/// Time for a killed process to end. The kernel holds one that waits for a device, as for a network
/// folder.
const KILL_TIMEOUT: Duration = Duration::from_secs(10);
const PERMANENT: i32 = RunError::PERMANENT as i32;

pub(crate) struct Child {
    pub plan: StagePlan,
    process: std::process::Child,
    pub started: Instant,
    status: Option<ExitStatus>,
    is_held: bool,
    deaths: VecDeque<Instant>,
    pose_at_restart: Option<Option<u64>>,
    log: Log,
    pub last_death: Option<String>,
    /// Why the last program that was given up for this one could not be started.
    pub start_error: Option<String>,
    before: Option<StagePlan>,
    /// True from a swap until the new program has worked on a pose.
    pub is_on_trial: bool,
}

impl Child {
    pub fn spawn(
        plan: &StagePlan,
        starter: &Starter<'_>,
        stands_by: bool,
    ) -> Result<Self, SuperviseError> {
        let log = Log::open(starter.manifest, &plan.name)?;
        let process = starter.start(plan, log.output(), stands_by)?;
        Ok(Self {
            plan: plan.clone(),
            process,
            started: Instant::now(),
            status: None,
            is_held: false,
            deaths: VecDeque::new(),
            pose_at_restart: None,
            log,
            last_death: None,
            start_error: None,
            before: None,
            is_on_trial: false,
        })
    }

    pub fn respawn(
        &mut self,
        starter: &Starter<'_>,
        newest_pose: Option<u64>,
    ) -> Result<(), SuperviseError> {
        if let Some(path) = self.plan.changed_file() {
            return Err(SuperviseError::Process(format!(
                "{} has ended, and {} has changed since it was started: another program may compute other motions; put back the one that the run was begun with",
                self.plan.name,
                path.display()
            )));
        }
        self.process = starter.start(&self.plan, self.log.output(), false)?;
        self.started = Instant::now();
        self.status = None;
        self.pose_at_restart = Some(newest_pose);
        Ok(())
    }

    /// Takes the place of a process that has ended, with another program that stood by for it.
    pub fn succeed(&mut self, mut successor: Self, newest_pose: Option<u64>) {
        successor.end_input();
        successor.started = Instant::now();
        successor.pose_at_restart = Some(newest_pose);
        successor.last_death = self.last_death.take();
        (successor.before, successor.is_on_trial) = (self.before.take(), self.is_on_trial);
        successor.try_after(self.plan.clone());
        std::mem::swap(self, &mut successor);
    }

    /// Lets a process that stands by open its topics.
    pub fn end_input(&mut self) {
        drop(self.process.stdin.take());
    }

    /// Uses a different program from the next start on.
    pub fn change(&mut self, plan: StagePlan) {
        let before = std::mem::replace(&mut self.plan, plan);
        self.deaths.clear();
        self.try_after(before);
    }

    /// A program that is itself on trial is not kept as a fallback.
    fn try_after(&mut self, before: StagePlan) {
        if !self.is_on_trial {
            self.before = Some(before);
        }
        self.is_on_trial = true;
    }

    /// Goes back to the previous program, or to `begun`, the first program of the run, if a file of
    /// the previous program has changed.
    pub fn go_back(&mut self, begun: &StagePlan) -> bool {
        let is_another = self.plan.command != begun.command;
        let plans = self.before.take().into_iter();
        let mut plans = plans.chain(is_another.then(|| begun.clone()));
        let Some(plan) = plans.find(|plan| plan.changed_file().is_none()) else {
            return false;
        };
        self.plan = plan;
        self.is_on_trial = false;
        self.deaths.clear();
        self.last_death = None;
        true
    }

    pub fn name(&self) -> &str {
        &self.plan.name
    }

    pub fn pid(&self) -> u32 {
        self.process.id()
    }

    pub fn stage(&self) -> Option<StageId> {
        StageId::by_name(self.name())
    }

    pub fn heartbeat(&self, manifest: &Manifest) -> Option<Heartbeat> {
        heartbeat::read(manifest, self.name(), self.pid())
    }

    /// Returns whether the process is a stage that has not opened its topics.
    pub fn is_starting(&self, run: &Run<'_>) -> bool {
        let stage = self.stage();
        stage.is_some_and(|stage| !run.services.has_publisher(stage))
    }

    /// Returns its state as `gyre ps` shows it; its activity is `otherwise` if it writes no
    /// heartbeat.
    pub fn status(&self, run: &Run<'_>, otherwise: Activity) -> ProcessStatus {
        let beat = self.heartbeat(run.manifest());
        let activity = match beat {
            _ if self.is_known_to_have_exited() => Activity::Ended,
            _ if self.is_starting(run) => Activity::Starting,
            None => otherwise,
            Some(beat) if beat.is_silent() => Activity::Silent,
            Some(beat) => match beat.activity {
                heartbeat::Activity::Works => Activity::Working,
                heartbeat::Activity::Waits => Activity::Waiting,
            },
        };
        ProcessStatus {
            name: self.name().to_owned(),
            pid: self.pid(),
            command: self.plan.command.clone(),
            is_swapped: false,
            activity,
            activity_s: beat.map(|beat| beat.age().as_secs_f64()),
            uptime_s: self.started.elapsed().as_secs_f64(),
            restarts: 0,
            last_death: self.last_death.clone(),
            missed: None,
            received: None,
        }
    }

    pub fn has_outlived_its_window(&self) -> bool {
        self.started.elapsed() > RESTART_WINDOW
    }

    pub fn died_without_progress(&self, newest_pose: Option<u64>) -> bool {
        self.pose_at_restart == Some(newest_pose)
    }

    pub fn has_exited(&mut self) -> bool {
        if self.status.is_none() {
            self.status = self.process.try_wait().ok().flatten();
            if self.status.is_some() {
                // End its own children too, such as a shell's.
                self.signal(Signal::KILL);
            }
        }
        self.status.is_some()
    }

    pub fn is_known_to_have_exited(&self) -> bool {
        self.status.is_some()
    }

    pub fn may_restart(&mut self, death: &Death) -> Result<(), SuperviseError> {
        if let Some(message) = self.message_if_permanent(death) {
            return Err(SuperviseError::Process(message));
        }
        self.deaths.push_back(Instant::now());
        self.deaths
            .retain(|death| death.elapsed() <= RESTART_WINDOW);
        if self.deaths.len() <= self.plan.restart.limit {
            return Ok(());
        }
        Err(SuperviseError::Process(format!(
            "{} died {} times within {} s, the last time by {}{}; giving up",
            self.name(),
            self.deaths.len(),
            RESTART_WINDOW.as_secs(),
            death.cause,
            death.output()
        )))
    }

    /// Returns the failure of an ended process if a restart would repeat it.
    pub fn permanent_failure(&mut self) -> Option<String> {
        self.status?;
        let death = self.death();
        self.message_if_permanent(&death)
    }

    fn message_if_permanent(&self, death: &Death) -> Option<String> {
        let message = || format!("{}: {}", self.name(), death.cause);
        let is_permanent = death.code == Some(PERMANENT);
        is_permanent.then(|| death.last_output.clone().unwrap_or_else(message))
    }

    pub fn death(&mut self) -> Death {
        let status = self.status.unwrap_or_default();
        let cause = match (status.signal(), status.code()) {
            (Some(signal), _) if signal == Signal::BUS.as_raw() => {
                format!("signal {signal} (is {SHARED_MEMORY} full?)")
            }
            (Some(signal), _) => format!("signal {signal}"),
            (None, code) => format!("exit code {}", code.unwrap_or_default()),
        };
        self.last_death = Some(cause.clone());
        Death {
            cause,
            code: status.code(),
            last_output: self.last_output(),
        }
    }

    pub fn terminate(&self) {
        if self.status.is_none() {
            self.signal(Signal::TERM);
        }
    }

    pub fn kill(&self) {
        if self.status.is_none() {
            self.signal(Signal::KILL);
        }
    }

    pub fn await_end(&mut self) -> Result<(), SuperviseError> {
        // After one wait in vain there is no second one.
        if !self.has_exited() && !self.is_held {
            self.is_held = !ends_within(&mut self.process, KILL_TIMEOUT);
        }
        match self.has_exited() {
            true => Ok(()),
            false => Err(SuperviseError::System(format!(
                "{} (process {}) does not end although it was killed: the kernel holds it, as it does while a disk or a network folder does not answer",
                self.name(),
                self.pid()
            ))),
        }
    }

    fn signal(&self, signal: Signal) {
        if let Some(group) = Pid::from_raw(self.process.id() as i32) {
            // Fails if all its processes have exited meanwhile.
            let _ = kill_process_group(group, signal);
        }
    }

    /// Returns the last line of its output since the last call: the reason that it gave.
    pub fn last_output(&mut self) -> Option<String> {
        self.log.last_line()
    }
}

#[derive(Clone, Debug)]
pub struct Death {
    /// The cause, as `signal 9` or `exit code 3`.
    pub cause: String,
    /// `None`: it was killed.
    pub code: Option<i32>,
    pub last_output: Option<String>,
}

impl Death {
    pub(crate) fn output(&self) -> String {
        let line = self.last_output.as_ref();
        line.map_or_else(String::new, |line| format!(" ({line})"))
    }
}

/// The end of a sentence, as `it ended with exit code 3, its last line: ...`.
impl fmt::Display for Death {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "it ended with {}", self.cause)?;
        match &self.last_output {
            Some(line) => write!(f, ", its last line: {line}"),
            None => Ok(()),
        }
    }
}

impl Drop for Child {
    fn drop(&mut self) {
        self.kill();
        let _ = self.await_end();
    }
}
