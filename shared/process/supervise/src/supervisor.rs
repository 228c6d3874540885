//! The loop of the supervisor. Its parts look at events and decide. The modules `restarts` (as
//! `recover`, `look_for_stalls`) and `requests` (as `serve`, `continue_swap`) carry out decisions.

use std::{
    collections::BTreeMap,
    time::{Duration, Instant},
};

use gyre_contract::{
    flag,
    run::{Report, StageCounters},
};
use gyre_stage::{counters, sink};
use gyre_transport::{
    transport,
    wake::{self, Signals},
};

use crate::{
    Ending, Event, Plan, SuperviseError,
    child::Child,
    clean,
    followers::Followers,
    log,
    poses::Poses,
    processes::Processes,
    recorder::Recorder,
    recovery::Recovery,
    run::Run,
    socket::ControlSocket,
    stall::Stalls,
    swaps::{ENDED, Swaps},
};

/// Time between two looks at the lengths of the logs.
const PERIOD: Duration = Duration::from_secs(1);

/// Runs all stages of `plan` until the stream ends, a signal requests a stop, or restarts do not
/// help.
///
/// Install the signals before acquiring the run's root. A signal in between would otherwise end the
/// process without cleanup.
pub fn supervise(
    plan: &Plan,
    signals: Signals,
    observe: &mut dyn FnMut(Event<'_>),
) -> Result<Report, SuperviseError> {
    transport::silence();
    let mut supervisor = Supervisor::new(plan, signals, observe)?;
    let ending = supervisor.start().and_then(|()| supervisor.watch());
    supervisor.stop(ending.as_ref().ok().copied())?;
    Ok(supervisor.report(ending?))
}

pub(crate) struct Supervisor<'a> {
    pub processes: Processes,
    /// An observer that the supervisor starts for `[record]`.
    pub recorder: Option<Recorder>,
    pub poses: Poses,
    pub recovery: Recovery,
    pub stalls: Stalls<'a>,
    pub followers: Followers<'a>,
    pub swaps: Swaps,
    pub socket: ControlSocket,
    /// When killed observers and the lengths of the logs are looked for again.
    sweep_due: Instant,
    logs_due: Instant,
    /// True when all stages have opened their topics once.
    is_ready: bool,
    /// The notice about the run that was reported last.
    pub notice: Option<String>,
    // Last: the processes end before their guardian, and the ports before their node.
    pub run: Run<'a>,
}

impl<'a> Supervisor<'a> {
    fn new(
        plan: &'a Plan,
        signals: Signals,
        observe: &'a mut dyn FnMut(Event<'_>),
    ) -> Result<Self, SuperviseError> {
        let run = Run::new(plan, signals, observe)?;
        Ok(Self {
            processes: Processes::default(),
            recorder: None,
            poses: Poses::of(&run)?,
            recovery: Recovery::default(),
            stalls: Stalls::of(plan),
            followers: Followers::of(plan),
            swaps: Swaps::default(),
            socket: ControlSocket::open(&plan.manifest.root)?,
            sweep_due: Instant::now() + PERIOD,
            logs_due: Instant::now(),
            is_ready: false,
            notice: None,
            run,
        })
    }

    fn start(&mut self) -> Result<(), SuperviseError> {
        self.recorder = Recorder::start(&mut self.run)?;
        self.processes.start(&mut self.run)
    }

    fn watch(&mut self) -> Result<Ending, SuperviseError> {
        loop {
            if self.sleep()? {
                return Ok(Ending::Interrupted);
            }
            self.serve()?;
            if self.read_poses()? {
                return self.await_followers();
            }
            self.swaps.continue_trial(&self.processes, &self.run);
            self.continue_swap()?;
            if !self.is_ready && self.processes.starting(&self.run).is_none() {
                self.is_ready = true;
                self.run.say(Event::Ready);
            }
            self.run.say(Event::Watched);
            self.keep_house()?;
            if Instant::now() >= self.sweep_due {
                let own = self.processes.len() + 1 + usize::from(self.recorder.is_some());
                self.sweep_due = clean::sweep_observers(&self.run, own);
            }
            let (followers, stages) = self.processes.ended(self.run.plan);
            self.recover_followers(&followers)?;
            match stages.is_empty() {
                true => self.look_for_stalls()?,
                false => self.recover(&stages)?,
            }
        }
    }

    /// Waits until the followers have read the logs to their end. If a follower is given up because
    /// it dies again and again, the followers behind it are not awaited: they read its log. The
    /// stream has ended, so the death of a stage changes nothing.
    fn await_followers(&mut self) -> Result<Ending, SuperviseError> {
        self.followers.are_awaited = true;
        // The last pose may have been the first of a program on trial.
        self.swaps.continue_trial(&self.processes, &self.run);
        self.swaps.end_trial(&self.processes);
        if let Some(standby) = self.swaps.standby.take() {
            self.give_up(standby, ENDED);
        }
        loop {
            let mut behind = self.followers.behind();
            let Some(first) = behind.first() else {
                return self.followers.end();
            };
            self.end_stuck_follower(*first)?;
            if self.sleep()? {
                return Ok(Ending::Interrupted);
            }
            self.serve()?;
            self.run.say(Event::Watched);
            self.keep_house()?;
            behind.retain(|i| self.processes[*i].has_exited());
            self.recover_followers(&behind)?;
        }
    }

    /// Sleeps until there is a pose, a request or a dead process; true on a request to stop.
    fn sleep(&self) -> Result<bool, SuperviseError> {
        let (poses, requests) = (self.poses.port.listener(), self.socket.descriptor());
        let woken =
            self.run
                .signals
                .wait_or_readable(&[poses], &[], Some(requests), wake::MAX_WAIT)?;
        Ok(woken.stop)
    }

    fn read_poses(&mut self) -> Result<bool, SuperviseError> {
        while let Some(received) = self.poses.next()? {
            let pose = received.header();
            if pose.item.is(flag::END) {
                return Ok(true);
            }
            self.stalls.progress(&pose.item);
            self.processes.pass_trials(pose, &self.recovery);
            self.recovery.see(pose);
            self.run.say(Event::Pose(pose));
        }
        Ok(false)
    }

    /// Keeps the logs short, and the processes alive that nothing depends on.
    fn keep_house(&mut self) -> Result<(), SuperviseError> {
        if Instant::now() >= self.logs_due {
            self.logs_due = Instant::now() + PERIOD;
            log::bound_all(self.run.manifest());
        }
        let notice = sink::notice(self.run.manifest());
        if notice != self.notice {
            let sentence = notice.as_deref();
            let has_room = "the disk has room again, and has all poses";
            self.run.note(sentence.unwrap_or(has_room));
            self.notice = notice;
        }
        let standby = self.swaps.standby.iter().map(|it| it.child.pid());
        let others = standby.chain(self.recorder.as_ref().map(Recorder::pid));
        let living = self.processes.iter().map(Child::pid).chain(others);
        self.run.keep_guardian(living);
        match &mut self.recorder {
            Some(recorder) => recorder.keep(&mut self.run, self.poses.newest_seq()),
            None => Ok(()),
        }
    }

    fn stop(&mut self, ending: Option<Ending>) -> Result<(), SuperviseError> {
        self.run.say(Event::Stopping);
        self.swaps.end_trial(&self.processes);
        let stopped = self.processes.stop(&mut self.run, ending);
        // After the stages, because they finish their current scans.
        if let Some(recorder) = &mut self.recorder {
            recorder.stop(&mut self.run, ending)?;
        }
        stopped?;
        log::bound_all(self.run.manifest());
        // Without an ending the run has failed already, and reports that failure.
        match ending {
            Some(_) => {
                self.processes.require_good_ends(&self.followers)?;
                self.require_kept()
            }
            None => Ok(()),
        }
    }

    /// Checks that no process was killed at its end with poses in memory.
    fn require_kept(&self) -> Result<(), SuperviseError> {
        match sink::notice(self.run.manifest()) {
            None => Ok(()),
            Some(notice) => Err(SuperviseError::Process(format!(
                "{notice}; the process that held them had no time to write them, and they are lost"
            ))),
        }
    }

    fn report(self, ending: Ending) -> Report {
        Report {
            ending,
            restarts: self.processes.restarts,
            recovery: self.recovery.times,
            counters: counters(self.run.plan),
            swaps: self.swaps.done,
        }
    }
}

fn counters(plan: &Plan) -> BTreeMap<String, StageCounters> {
    let names = plan.stages.iter().map(|stage| &stage.name);
    names
        .filter_map(|name| Some((name.clone(), counters::read(&plan.manifest, name)?)))
        .collect()
}
