//! Starts the processes of a run, repairs the run when one dies, and leaves nothing behind.
//!
//! After a death only the dead stage is cleaned up after and restarted: a start resumes. Where that does not help (it dies
//! again before a new pose, no pose comes at all, or its plan says so) all are restarted.

mod child;
mod clean;
mod plan;

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
    services::{self, Node, Services},
    wake::{self, Signals},
};
use child::Child;

pub use child::Death;
pub use plan::{Ending, Event, Plan, Report, RestartPolicy, StagePlan, SuperviseError};

/// Time that stages have to end by themselves before they are killed.
const STOP_TIMEOUT: Duration = Duration::from_secs(2);

/// Runs all stages of `plan` until the stream ends, one of `signals` asks to stop, or nothing helps any more.
///
/// The signals are to be installed before the run's place in shared memory is taken: else one that comes in between would end
/// the process with nobody left to clean up.
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
    newest_pose: Option<u64>,
    last_progress: Instant,
    stalls_without_progress: usize,
    restarts: BTreeMap<String, usize>,
    /// Stages that were started again and have not yet shown a pose of their new life: since when they were dead.
    recovering: Vec<Recovering>,
    recovery: Vec<Duration>,
    // Dropped in this order: ports, services, node.
    poses: Port<Pose>,
    _services: Services,
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
        let services = Services::create(&node, &manifest.window)?;
        let poses = Port::on(&node)?;
        Ok(Self {
            plan,
            observe,
            children: Vec::new(),
            newest_pose: None,
            last_progress: Instant::now(),
            stalls_without_progress: 0,
            restarts: BTreeMap::new(),
            recovering: Vec::new(),
            recovery: Vec::new(),
            poses,
            _services: services,
            _node: node,
            transport,
            signals,
        })
    }

    fn start(&mut self) -> Result<(), SuperviseError> {
        for stage in &self.plan.stages {
            let child = Child::spawn(stage, &self.plan.manifest)?;
            (self.observe)(Event::Started {
                stage: &stage.name,
                pid: child.pid(),
            });
            self.children.push(child);
        }
        Ok(())
    }

    fn watch(&mut self) -> Result<Ending, SuperviseError> {
        self.last_progress = Instant::now();
        loop {
            let woken = self
                .signals
                .wait(&[self.poses.listener()], None, wake::MAX_WAIT)?;
            if woken.stop {
                return Ok(Ending::Interrupted);
            }
            if self.read_poses()? {
                return Ok(Ending::Complete);
            }
            let dead: Vec<usize> = (0..self.children.len())
                .filter(|i| self.children[*i].has_ended())
                .collect();
            if !dead.is_empty() {
                self.repair(&dead)?;
            } else if self
                .plan
                .stall_timeout
                .is_some_and(|limit| self.last_progress.elapsed() > limit)
            {
                self.unstall()?;
            }
        }
    }

    /// Takes in the poses that have come; true at the end of the stream.
    fn read_poses(&mut self) -> Result<bool, SuperviseError> {
        while let Some(received) = self.poses.receive()? {
            let pose = received.header();
            if pose.item.is(flag::END) {
                return Ok(true);
            }
            let news = !pose.item.is(flag::BASE)
                && self.newest_pose.is_none_or(|newest| pose.item.seq > newest);
            if news {
                self.newest_pose = Some(pose.item.seq);
                self.last_progress = Instant::now();
                self.stalls_without_progress = 0;
                note_recoveries(pose, &mut self.recovering, &mut self.recovery);
                (self.observe)(Event::Pose(pose));
            }
        }
        Ok(false)
    }

    /// Starts dead stages again, or everybody where that alone would not help.
    fn repair(&mut self, dead: &[usize]) -> Result<(), SuperviseError> {
        let died_ns = clock::now_ns();
        let mut everybody = false;
        let mut backoff = Duration::ZERO;
        for i in dead {
            let child = &mut self.children[*i];
            let death = child.death();
            (self.observe)(Event::Died {
                stage: child.name(),
                death: &death,
            });
            child.may_restart(&death)?;
            everybody |= child.died_without_progress(self.newest_pose);
            everybody |= child.plan().restarts_all;
            if !death.killed {
                backoff = backoff.max(child.backoff());
            }
            *self.restarts.entry(child.name().to_owned()).or_default() += 1;
        }
        if !backoff.is_zero() {
            self.signals.wait(&[], None, backoff)?;
        }
        let again: Vec<usize> = if everybody {
            self.generation(dead)
        } else {
            dead.to_vec()
        };
        self.restart(&again, died_ns)?;
        (self.observe)(Event::Restarted { everybody });
        Ok(())
    }

    /// All stages, but those that live and outlive restarts.
    fn generation(&self, dead: &[usize]) -> Vec<usize> {
        let stays = |i: &usize| self.children[*i].plan().outlives_restarts && !dead.contains(i);
        (0..self.children.len()).filter(|i| !stays(i)).collect()
    }

    fn restart(&mut self, again: &[usize], died_ns: i64) -> Result<(), SuperviseError> {
        for i in again {
            self.children[*i].kill();
        }
        let nobody_lives = again.len() == self.children.len();
        clean::after_the_dead(&self.plan.manifest, &self.transport, nobody_lives)?;
        for i in again {
            let child = &mut self.children[*i];
            child.respawn(&self.plan.manifest, self.newest_pose)?;
            let hop = StageId::by_name(child.name());
            self.recovering.extend(hop.map(|hop| Recovering {
                hop,
                died_ns,
                started_ns: clock::now_ns(),
            }));
        }
        self.last_progress = Instant::now();
        Ok(())
    }

    /// No pose for too long: somebody is alive but stuck, so start everybody again, though not for ever.
    fn unstall(&mut self) -> Result<(), SuperviseError> {
        self.stalls_without_progress += 1;
        if self.stalls_without_progress > 2 {
            return Err(SuperviseError::Stalled {
                after: self.plan.stall_timeout.unwrap_or_default(),
            });
        }
        (self.observe)(Event::Stalled);
        self.restart(&self.generation(&[]), clock::now_ns())
    }

    /// Asks all to end, and ends those that do not.
    fn stop(&mut self) -> Result<(), SuperviseError> {
        self.children.iter().for_each(Child::ask_to_end);
        let patience = Instant::now() + STOP_TIMEOUT;
        while Instant::now() < patience && !self.children.iter_mut().all(Child::has_ended) {
            self.signals.wait(&[], None, wake::MAX_WAIT)?;
        }
        self.children.iter_mut().for_each(Child::kill);
        Ok(())
    }
}

/// A stage has recovered when a pose comes that its new life has worked on; poses that were on their way do not count.
fn note_recoveries(
    pose: &PoseHeader,
    recovering: &mut Vec<Recovering>,
    recovery: &mut Vec<Duration>,
) {
    let hops = pose.item().hops;
    recovering.retain(|stage| {
        let back = hops[stage.hop as usize].started_ns > stage.started_ns;
        if back {
            recovery.push(Duration::from_nanos(
                (clock::now_ns() - stage.died_ns).max(0) as u64,
            ));
        }
        !back
    });
}

/// The transport cleans up after half-made nodes by its global configuration, not by the run's: they must be the same.
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

/// What the stages left of themselves at their orderly ends, by name.
fn counters(plan: &Plan) -> BTreeMap<String, StageCounters> {
    let left = |stage: &StagePlan| {
        let text =
            fs::read_to_string(plan.manifest.root.join(counters::file_name(&stage.name))).ok()?;
        Some((stage.name.clone(), serde_json::from_str(&text).ok()?))
    };
    plan.stages.iter().filter_map(left).collect()
}
