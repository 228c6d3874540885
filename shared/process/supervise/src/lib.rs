//! Starts the processes of a run, restarts dead ones, and removes all resources at the end.
//!
//! After a death only the dead stage is restarted: every start resumes. All stages are restarted if that does not help (the
//! stage dies again before a new pose, or no pose is published) or if the plan says so. Followers are no part of that: they are
//! restarted alone, and waited for at the end. [`rig`] runs one process alone, to test it.

// `pre_exec` and raw file descriptors need `unsafe`; each use states why it is sound.
#![allow(unsafe_code)]

mod child;
mod clean;
mod end;
mod follow;
mod guardian;
mod log;
mod observers;
mod plan;
mod program;
mod recorder;
mod recovery;
mod requests;
pub mod rig;
mod scheduling;
mod socket;
mod stall;
mod start;
mod swap;
mod trial;
mod wake_limit;
mod watchdog;

use std::{
    collections::BTreeMap,
    time::{Duration, Instant},
};

use gyre_messages::{Item, Pose, flag};
use gyre_stage::{
    StageCounters, StageError,
    reader::Port,
    run,
    services::{self, Node, Services},
    wake::{self, Signals},
};
use iceoryx2::prelude::{Config, FilePath, SemanticString};

use child::Child;
use guardian::Guardian;
use recovery::{Recovering, pass_trials, record_recoveries};
use socket::ControlSocket;
use start::{Place, Starter};
use swap::Standby;
use trial::Trial;
use watchdog::Watchdog;

pub use child::Death;
pub use guardian::guard;
pub use log::last_line;
pub use plan::{
    Ending, Event, Plan, Report, RestartPolicy, StagePlan, Stall, SuperviseError, Swapped,
};
pub use program::Program;
pub use scheduling::Scheduling;

/// Time for stages to exit by themselves before they are killed.
const STOP_TIMEOUT: Duration = Duration::from_secs(2);

/// Runs all stages of `plan` until the stream ends, a signal requests a stop, or restarts do not help.
///
/// Install the signals before acquiring the run's root. A signal in between would otherwise end the process without cleanup.
///
/// # Errors
/// A stage that cannot be started or fails too often, a stall, or a failure of the transport.
pub fn supervise(
    plan: &Plan,
    signals: Signals,
    observe: &mut dyn FnMut(Event<'_>),
) -> Result<Report, SuperviseError> {
    iceoryx2::prelude::set_log_level(iceoryx2::prelude::LogLevel::Fatal);
    let mut supervisor = Supervisor::new(plan, signals, observe)?;
    let ending = supervisor.start().and_then(|()| supervisor.watch());
    (supervisor.observe)(Event::Stopping);
    supervisor.end_trial();
    supervisor.stop_recorder(ending.as_ref().ok().copied())?;
    supervisor.stop()?;
    let ending = ending?;
    Ok(Report {
        ending,
        restarts: supervisor.restarts,
        recovery: supervisor.recovery,
        counters: counters(plan),
        swaps: supervisor.swaps,
    })
}

struct Supervisor<'a> {
    plan: &'a Plan,
    observe: &'a mut dyn FnMut(Event<'_>),
    children: Vec<Child>,
    /// No stage, and no follower.
    recorder: Option<recorder::Recorder>,
    /// Outlives the stages, which it cares for.
    guardian: Guardian,
    since: Instant,
    /// The item of the newest pose, and when it was seen.
    newest: Option<Item>,
    last_pose: Option<Instant>,
    /// True when all stages have opened their topics once.
    is_ready: bool,
    /// True when the stream has ended, and followers are waited for.
    is_following: bool,
    watchdog: Watchdog,
    hangs: stall::Looks,
    socket: ControlSocket,
    /// The program that stands by to take the place of another one.
    standby: Option<Standby>,
    /// Who waits for a program that has taken over to prove itself.
    trial: Option<Trial>,
    swaps: Vec<Swapped>,
    restarts: BTreeMap<String, usize>,
    /// Followers that are not restarted any more, and why.
    given_up: Vec<(usize, SuperviseError)>,
    /// Restarted stages with no pose yet that the new process worked on.
    recovering: Vec<Recovering>,
    recovery: Vec<Duration>,
    observers: observers::Sweep,
    logs: log::Logs,
    _wake_limit: Option<wake_limit::WakeLimit>,
    // Dropped in this order: ports, services, node.
    poses: Port<Pose>,
    services: Services,
    _node: Node,
    transport: Config,
    signals: Signals,
}

impl<'a> Supervisor<'a> {
    fn new(
        plan: &'a Plan,
        signals: Signals,
        observe: &'a mut dyn FnMut(Event<'_>),
    ) -> Result<Self, SuperviseError> {
        let manifest = &plan.manifest;
        let transport = manifest.transport()?;
        use_as_global(&manifest.root.join("iox.toml"))?;
        let node = services::node(&transport, "supervisor")?;
        run::close_to_others(&manifest.prefix)
            .map_err(|e| StageError::transport("close shared memory to other users", e))?;
        let services = Services::create(&node, &manifest.window)?;
        let poses = Port::on(&node, manifest)?;
        Ok(Self {
            plan,
            observe,
            children: Vec::new(),
            recorder: None,
            guardian: Guardian::start(&plan.guardian, manifest)?,
            since: Instant::now(),
            newest: None,
            last_pose: None,
            is_ready: false,
            is_following: false,
            watchdog: Watchdog::new(plan),
            hangs: stall::Looks::new(),
            socket: ControlSocket::open(manifest)?,
            standby: None,
            trial: None,
            swaps: Vec::new(),
            restarts: BTreeMap::new(),
            given_up: Vec::new(),
            recovering: Vec::new(),
            recovery: Vec::new(),
            observers: observers::Sweep::new(),
            logs: log::Logs::of(plan),
            _wake_limit: plan
                .cpu_wake_us
                .map(wake_limit::WakeLimit::hold)
                .transpose()?,
            poses,
            services,
            _node: node,
            transport,
            signals,
        })
    }

    fn start(&mut self) -> Result<(), SuperviseError> {
        self.start_recorder()?;
        for stage in &self.plan.stages {
            let child = Child::spawn(
                stage,
                &self.plan.manifest,
                &Starter::new(&self.signals, &self.guardian),
                Place::Free,
            )?;
            (self.observe)(Event::Started {
                stage: &stage.name,
                pid: child.pid(),
            });
            self.children.push(child);
        }
        Ok(())
    }

    fn watch(&mut self) -> Result<Ending, SuperviseError> {
        loop {
            if self.sleep()? || self.serve()? {
                return Ok(Ending::Interrupted);
            }
            if self.read_poses()? {
                return self.await_followers();
            }
            self.continue_trial();
            self.continue_swap()?;
            self.report_readiness();
            self.logs.bound_if_due();
            self.keep_guardian();
            self.keep_recorder()?;
            let processes = self.children.len() + 1 + usize::from(self.recorder.is_some());
            self.observers
                .run_if_due(&self.plan.manifest, &self.transport, processes);
            let exited: Vec<usize> = (0..self.children.len())
                .filter(|i| self.children[*i].has_exited())
                .collect();
            let (mut followers, dead): (Vec<usize>, Vec<usize>) = exited
                .into_iter()
                .partition(|i| self.children[*i].follows());
            followers.retain(|i| self.is_behind(*i));
            self.recover_followers(&followers)?;
            if !dead.is_empty() {
                self.recover(&dead)?;
            } else if let Some(stall) = self.stall() {
                self.recover_from_stall(stall)?;
            }
        }
    }

    /// Sleeps until there is a pose, a request or a dead process; true on a request to stop.
    fn sleep(&self) -> Result<bool, SuperviseError> {
        let (poses, requests) = (self.poses.listener(), self.socket.descriptor());
        let woken = self
            .signals
            .wait_or_readable(&[poses], &[], Some(requests), wake::MAX_WAIT)?;
        Ok(woken.stop)
    }

    fn report_readiness(&mut self) {
        let mut stages = self.children.iter().filter_map(Child::stage);
        if !self.is_ready && stages.all(|stage| self.services.has_publisher(stage)) {
            self.is_ready = true;
            (self.observe)(Event::Ready);
        }
        (self.observe)(Event::Watched);
    }

    /// Replaces a guardian that somebody has killed. If there is no room for a process it is tried again at the next wake-up.
    fn keep_guardian(&mut self) {
        if self.guardian.has_ended()
            && let Ok(guardian) = Guardian::start(&self.plan.guardian, &self.plan.manifest)
        {
            self.guardian = guardian;
            let standby = self.standby.as_ref().map(Standby::pid);
            let recorder = self.recorder.as_ref().map(recorder::Recorder::pid);
            let others = standby.into_iter().chain(recorder);
            let living = self.children.iter().map(Child::pid).chain(others);
            living.for_each(|group| self.guardian.remember(group));
        }
    }

    /// Reads the new poses; true at the end of the stream.
    fn read_poses(&mut self) -> Result<bool, SuperviseError> {
        while let Some(received) = self.poses.receive()? {
            let pose = received.header();
            if pose.item.is(flag::END) {
                return Ok(true);
            }
            let is_new = !pose.item.is(flag::BASE)
                && self.newest.is_none_or(|newest| pose.item.seq > newest.seq);
            if is_new {
                (self.newest, self.last_pose) = (Some(pose.item), Some(Instant::now()));
                self.watchdog.progress(&pose.item);
                pass_trials(pose, &mut self.children, &self.recovering);
                record_recoveries(pose, &mut self.recovering, &mut self.recovery);
                (self.observe)(Event::Pose(pose));
            }
        }
        Ok(false)
    }

    /// Stops all stages, and kills those that do not exit in time.
    fn stop(&mut self) -> Result<(), SuperviseError> {
        self.children.iter().for_each(Child::terminate);
        let deadline = Instant::now() + STOP_TIMEOUT;
        while Instant::now() < deadline && !self.children.iter_mut().all(Child::has_exited) {
            self.signals.wait(&[], None, wake::MAX_WAIT)?;
            (self.observe)(Event::Watched);
        }
        self.children.iter().for_each(Child::kill);
        for child in &mut self.children {
            child.await_end()?;
            self.guardian.forget(child.pid());
        }
        self.logs.bound();
        Ok(())
    }
}

/// Makes the run's configuration of the transport the global one, which the transport uses to clean up incomplete nodes.
fn use_as_global(path: &std::path::Path) -> Result<(), StageError> {
    let failed = |reason: String| StageError::Manifest {
        path: path.to_owned(),
        reason,
    };
    let file =
        FilePath::new(path.as_os_str().as_encoded_bytes()).map_err(|e| failed(format!("{e:?}")))?;
    Config::setup_global_config_from_file(&file).map_err(|e| failed(format!("{e:?}")))?;
    Ok(())
}

/// Reads the counters of the stages that exited cleanly, by name.
fn counters(plan: &Plan) -> BTreeMap<String, StageCounters> {
    let read = |stage: &StagePlan| {
        let counters = StageCounters::of(&plan.manifest, &stage.name)?;
        Some((stage.name.clone(), counters))
    };
    plan.stages.iter().filter_map(read).collect()
}
