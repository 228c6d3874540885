//! Starts the processes of a run, restarts dead ones, and removes all resources at the end.
//!
//! After a death only the dead stage is restarted: every start resumes. All stages are restarted if that does not help (the
//! stage dies again before a new pose, or no pose is published) or if the plan says so. Followers are no part of that: they are
//! restarted alone, and waited for at the end.

mod child;
mod clean;
mod end;
mod follow;
mod guardian;
mod log;
mod observers;
mod plan;
mod program;
mod start;
mod watchdog;

use std::{
    collections::BTreeMap,
    fs,
    time::{Duration, Instant},
};

use gyre_messages::{Header, Pose, PoseHeader, StageId, flag};
use iceoryx2::prelude::{Config, FilePath, SemanticString};

use crate::{
    StageCounters, StageError, clock, counters,
    reader::Port,
    run,
    services::{self, Node, Services},
    wake::{self, Signals},
};
use child::Child;
use guardian::Guardian;
use start::Starter;
use watchdog::{Starting, Watchdog};

pub use child::Death;
pub use guardian::guard;
pub use plan::{Ending, Event, Plan, Report, RestartPolicy, StagePlan, Stall, SuperviseError};
pub use program::Program;

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
    supervisor.stop()?;
    let (restarts, recovery) = (supervisor.restarts, supervisor.recovery);
    Ok(Report {
        ending: ending?,
        restarts,
        recovery,
        counters: counters(plan),
    })
}

struct Supervisor<'a> {
    plan: &'a Plan,
    observe: &'a mut dyn FnMut(Event<'_>),
    children: Vec<Child>,
    /// Outlives the stages, which it cares for.
    guardian: Guardian,
    newest_pose: Option<u64>,
    watchdog: Watchdog,
    restarts: BTreeMap<String, usize>,
    /// Followers that are not restarted any more, and why.
    given_up: Vec<(usize, SuperviseError)>,
    /// Restarted stages with no pose yet that the new process worked on.
    recovering: Vec<Recovering>,
    recovery: Vec<Duration>,
    observers: observers::Sweep,
    logs: log::Logs,
    // Dropped in this order: ports, services, node.
    poses: Port<Pose>,
    services: Services,
    _node: Node,
    transport: Config,
    signals: Signals,
}

struct Recovering {
    hop: StageId,
    died_ns: i64,
    started_ns: i64,
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
            guardian: Guardian::start(&plan.guardian, manifest)?,
            newest_pose: None,
            watchdog: Watchdog::new(plan),
            restarts: BTreeMap::new(),
            given_up: Vec::new(),
            recovering: Vec::new(),
            recovery: Vec::new(),
            observers: observers::Sweep::new(),
            logs: log::Logs::of(plan),
            poses,
            services,
            _node: node,
            transport,
            signals,
        })
    }

    fn start(&mut self) -> Result<(), SuperviseError> {
        for stage in &self.plan.stages {
            let child = Child::spawn(
                stage,
                &self.plan.manifest,
                &Starter::new(&self.signals, &self.guardian),
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
            let woken = self
                .signals
                .wait(&[self.poses.listener()], None, wake::MAX_WAIT)?;
            if woken.stop {
                return Ok(Ending::Interrupted);
            }
            if self.read_poses()? {
                return self.await_followers();
            }
            self.logs.bound_if_due();
            self.keep_guardian();
            let processes = self.children.len() + 1;
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

    /// Replaces a guardian that somebody has killed. If there is no room for a process it is tried again at the next wake-up.
    fn keep_guardian(&mut self) {
        if self.guardian.has_ended()
            && let Ok(guardian) = Guardian::start(&self.plan.guardian, &self.plan.manifest)
        {
            self.guardian = guardian;
            let living = self.children.iter().map(Child::pid);
            living.for_each(|group| self.guardian.remember(group));
        }
    }

    fn stall(&mut self) -> Option<Stall> {
        let opening = self.children.iter().filter(|child| {
            child
                .stage()
                .is_some_and(|stage| !self.services.has_publisher(stage))
        });
        let starting = opening
            .min_by_key(|child| child.started())
            .map(|child| Starting {
                stage: child.name(),
                since: child.started(),
            });
        self.watchdog.look(&self.plan.manifest, starting)
    }

    /// Reads the new poses; true at the end of the stream.
    fn read_poses(&mut self) -> Result<bool, SuperviseError> {
        while let Some(received) = self.poses.receive()? {
            let pose = received.header();
            if pose.item.is(flag::END) {
                return Ok(true);
            }
            let is_new = !pose.item.is(flag::BASE)
                && self.newest_pose.is_none_or(|newest| pose.item.seq > newest);
            if is_new {
                self.newest_pose = Some(pose.item.seq);
                self.watchdog.progress(&pose.item);
                record_recoveries(pose, &mut self.recovering, &mut self.recovery);
                (self.observe)(Event::Pose(pose));
            }
        }
        Ok(false)
    }

    /// Restarts dead stages, or all stages if that alone would not help.
    fn recover(&mut self, dead: &[usize]) -> Result<(), SuperviseError> {
        let died_ns = clock::now_ns();
        self.may_restart(dead)?;
        let all = dead.iter().any(|i| {
            let child = &self.children[*i];
            child.died_without_progress(self.newest_pose) || child.plan().restarts_all
        });
        match all {
            true => self.restart(&self.all_but_survivors(dead), died_ns)?,
            false => self.restart(dead, died_ns)?,
        }
        (self.observe)(Event::Restarted { all });
        Ok(())
    }

    /// Counts deaths against the restart policies, and waits for the longest backoff.
    fn may_restart(&mut self, dead: &[usize]) -> Result<(), SuperviseError> {
        let mut backoff = Duration::ZERO;
        for i in dead {
            let child = &mut self.children[*i];
            let death = child.death();
            (self.observe)(Event::Died {
                stage: child.name(),
                death: &death,
            });
            child.may_restart(&death)?;
            if !death.killed {
                backoff = backoff.max(child.backoff());
            }
            *self.restarts.entry(child.name().to_owned()).or_default() += 1;
        }
        if !backoff.is_zero() {
            self.signals.wait(&[], None, backoff)?;
        }
        Ok(())
    }

    /// Returns all stages.
    fn all(&self) -> impl Iterator<Item = usize> + '_ {
        (0..self.children.len()).filter(|i| !self.children[*i].follows())
    }

    /// Returns all stages except those that are alive and outlive restarts.
    fn all_but_survivors(&self, dead: &[usize]) -> Vec<usize> {
        let survives = |i: &usize| self.children[*i].plan().outlives_restarts && !dead.contains(i);
        self.all().filter(|i| !survives(i)).collect()
    }

    fn restart(&mut self, stages: &[usize], died_ns: i64) -> Result<(), SuperviseError> {
        self.replace(stages, died_ns)?;
        self.watchdog.restarted();
        Ok(())
    }

    /// Ends processes and starts others in their places.
    fn replace(&mut self, stages: &[usize], died_ns: i64) -> Result<(), SuperviseError> {
        stages.iter().for_each(|i| self.children[*i].kill());
        for i in stages {
            self.children[*i].await_end()?;
            self.guardian.forget(self.children[*i].pid());
        }
        let all_dead = stages.len() == self.children.len();
        clean::remove_dead(&self.plan.manifest, &self.transport, all_dead)?;
        for i in stages {
            let starter = Starter::new(&self.signals, &self.guardian);
            let child = &mut self.children[*i];
            child.respawn(&self.plan.manifest, &starter, self.newest_pose)?;
            self.recovering.extend(child.stage().map(|hop| Recovering {
                hop,
                died_ns,
                started_ns: clock::now_ns(),
            }));
        }
        Ok(())
    }

    /// Restarts the stages that may be stuck: first the source if it is late, else all but a live source; when that does not
    /// help, all stages; when that does not help either, the run ends.
    fn recover_from_stall(&mut self, stall: Stall) -> Result<(), SuperviseError> {
        let stages = match (self.watchdog.count(), &stall) {
            (1, Stall::Scan { .. }) => self.sources(),
            (1, _) => self.all_but_survivors(&[]),
            (2, _) => self.all().collect(),
            _ => return Err(SuperviseError::Stalled(stall)),
        };
        (self.observe)(Event::Stalled(&stall));
        for i in &stages {
            *self
                .restarts
                .entry(self.children[*i].name().to_owned())
                .or_default() += 1;
        }
        self.restart(&stages, clock::now_ns())?;
        let all = stages.len() > 1;
        (self.observe)(Event::Restarted { all });
        Ok(())
    }

    fn sources(&self) -> Vec<usize> {
        let is_source = |i: &usize| self.children[*i].stage() == Some(StageId::RadarReplay);
        (0..self.children.len()).filter(is_source).collect()
    }

    /// Stops all stages, and kills those that do not exit in time.
    fn stop(&mut self) -> Result<(), SuperviseError> {
        self.children.iter().for_each(Child::terminate);
        let deadline = Instant::now() + STOP_TIMEOUT;
        while Instant::now() < deadline && !self.children.iter_mut().all(Child::has_exited) {
            self.signals.wait(&[], None, wake::MAX_WAIT)?;
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

/// Records the recovery of stages at the first pose that their new processes worked on; items in flight do not count.
fn record_recoveries(
    pose: &PoseHeader,
    recovering: &mut Vec<Recovering>,
    recovery: &mut Vec<Duration>,
) {
    let hops = pose.item().hops;
    recovering.retain(|stage| {
        let recovered = hops[stage.hop as usize].started_ns > stage.started_ns;
        if recovered {
            recovery.push(Duration::from_nanos(
                (clock::now_ns() - stage.died_ns).max(0) as u64,
            ));
        }
        !recovered
    });
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
        let text =
            fs::read_to_string(plan.manifest.root.join(counters::file_name(&stage.name))).ok()?;
        Some((stage.name.clone(), serde_json::from_str(&text).ok()?))
    };
    plan.stages.iter().filter_map(read).collect()
}
