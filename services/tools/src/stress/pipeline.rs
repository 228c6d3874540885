//! One run from its start to its end, with its load and faults, as an observer of `pose` sees it.

mod running;

use std::{
    path::Path,
    sync::{Arc, Weak},
    thread,
    time::{Duration, Instant},
};

use gyre_client::{Next, Observer, RunError, clock};
use gyre_configuration::terminal::Failure;
use gyre_contract::{Footprint, Pose, PoseHeader, StageId, run::Scenario};
use running::Running;

use crate::stress::{
    TestedPipeline,
    fault::{FaultKind, Faults},
    helper::{Helper, Work},
    processes::Sampler,
    record::Recorder,
    report::Figures,
};

/// The time after the measurement during which late poses still count.
const GRACE: Duration = Duration::from_secs(10);
/// Time between two polls of faults and processes.
const TICK: Duration = Duration::from_millis(20);
const SAMPLE_EVERY: Duration = Duration::from_secs(1);

#[derive(Clone, Debug)]
pub struct Setup {
    pub scenario: Scenario,
    pub name: String,
    pub rate_hz: f64,
    pub duration: Duration,
    /// Overrides of the configuration, `section.key=value`.
    pub set: Vec<String>,
    /// Scans that become due at once.
    pub burst: u64,
    /// Helpers that load the machine while it is measured.
    pub loads: Vec<Work>,
    pub faults: Option<(FaultKind, Vec<StageId>)>,
}

impl Setup {
    pub fn undisturbed(scenario: Scenario, rate_hz: f64, duration: Duration) -> Self {
        Self {
            scenario,
            name: scenario.name().to_owned(),
            rate_hz,
            duration,
            set: Vec::new(),
            burst: 1,
            loads: Vec::new(),
            faults: None,
        }
    }
}

#[derive(Clone, Debug)]
pub struct Measured {
    pub figures: Figures,
    /// A load or a fault that was omitted, so that the figures are not of this scenario.
    pub omitted: Option<String>,
    /// The reason why it ended although it was still measured.
    pub died: Option<String>,
}

/// Starts a run, measures it, and ends it. Pipelines that are measured together have one ticket:
/// the measurement begins when each has given up its share of it, after the warm-up or by a
/// failure.
pub fn measure(
    tested: &TestedPipeline,
    setup: &Setup,
    ticket: Arc<()>,
) -> Result<Measured, Failure> {
    let held = Arc::downgrade(&ticket);
    let mut run = Running::start(tested, setup)?;
    let observed = run.attach()?;
    let mut poses = observed.observe::<Pose>()?;
    let mut newest = run.warm_up(&mut poses)?;
    let loads = setup.loads.iter().cloned().map(Helper::start);
    let mut loads: Vec<Helper> = loads.collect::<Result<_, _>>()?;
    drop(ticket);
    await_others(&held, &mut poses, &mut newest)?;
    let mut session = Session::begin((tested, setup), run.pid(), &run.out, &newest);
    let has_ended = session.measure(&mut poses, || run.has_ended())?;
    let ended_load = loads.iter_mut().find_map(Helper::has_died);
    drop(loads);
    let processes = session.processes.costs();
    let motions = session.recorder.motions;
    let latency = session.recorder.finish(session.period_ns, clock::now_ns());
    let faults = session.faults.map(Faults::finish);
    let (faults, omitted) = faults.unwrap_or_default();
    let manifest = observed.manifest();
    let shared_bytes = Footprint::new(&manifest.window, &manifest.limits).total() as u64;
    drop(poses);
    drop(observed);
    let died = has_ended.then(|| run.last_words());
    // It writes its results, with the figures of its stages.
    drop(run);
    let ended_load =
        ended_load.map(|ended| format!("the load was not there all the time: {ended}"));
    Ok(Measured {
        omitted: omitted.or(ended_load),
        figures: Figures {
            latency,
            faults,
            motions,
            processes,
            shared_bytes,
        },
        died,
    })
}

fn await_others(
    held: &Weak<()>,
    poses: &mut Observer<Pose>,
    newest: &mut PoseHeader,
) -> Result<(), RunError> {
    loop {
        if drain(poses, TICK, &mut |pose| *newest = *pose)? {
            // It returns at once when the run has ended.
            thread::sleep(TICK);
        }
        if held.strong_count() == 0 {
            return Ok(());
        }
    }
}

/// Takes the poses that come within `limit`; true if the run has ended.
fn drain(
    poses: &mut Observer<Pose>,
    mut limit: Duration,
    take: &mut dyn FnMut(&PoseHeader),
) -> Result<bool, RunError> {
    loop {
        match poses.next(limit)? {
            Next::Message(pose, _) => take(pose.header()),
            Next::Idle => return Ok(false),
            Next::Ended => return Ok(true),
        }
        limit = Duration::ZERO;
    }
}

/// The measurement, from the first scan after the warm-up on.
struct Session {
    recorder: Recorder,
    processes: Sampler,
    faults: Option<Faults>,
    period_ns: i64,
    ends_ns: i64,
    sampled: Instant,
}

impl Session {
    fn begin(
        (tested, setup): (&TestedPipeline, &Setup),
        supervisor: u32,
        out: &Path,
        newest: &PoseHeader,
    ) -> Self {
        let began_ns = clock::now_ns();
        let ends_ns = began_ns + setup.duration.as_nanos() as i64;
        let (faults, turn_end) = (setup.faults.clone(), tested.turn.end as u64);
        let mut recorder = Recorder::new(began_ns..ends_ns, setup.burst, turn_end);
        recorder.add(newest);
        Self {
            recorder,
            processes: Sampler::new(supervisor, out),
            faults: faults.map(|faults| Faults::new(faults, began_ns, setup.duration)),
            period_ns: (1e9 / setup.rate_hz) as i64,
            ends_ns,
            sampled: Instant::now(),
        }
    }

    /// Measures until it is over; true if the run has ended before that.
    fn measure(
        &mut self,
        poses: &mut Observer<Pose>,
        mut has_ended: impl FnMut() -> bool,
    ) -> Result<bool, RunError> {
        while !self.is_over() {
            let is_last = drain(poses, TICK, &mut |pose| self.add(pose))?;
            self.poll();
            // The stream ends first, then the process: that may be still there.
            if is_last || has_ended() {
                return Ok(true);
            }
        }
        Ok(has_ended())
    }

    fn add(&mut self, pose: &PoseHeader) {
        self.recorder.add(pose);
        if let Some(faults) = &mut self.faults {
            faults.pose(pose);
        }
    }

    fn poll(&mut self) {
        if let Some(faults) = &mut self.faults {
            faults.act(&self.processes);
        }
        if self.sampled.elapsed() >= SAMPLE_EVERY && clock::now_ns() < self.ends_ns {
            self.processes.sample();
            self.sampled = Instant::now();
        }
    }

    /// It is over when no pose of the measured time is owed any more, or when that takes too long.
    fn is_over(&self) -> bool {
        let now_ns = clock::now_ns();
        if now_ns < self.ends_ns {
            return false;
        }
        let faults = self.faults.as_ref().is_some_and(Faults::are_open);
        let is_owed = self.recorder.owes(self.period_ns) || faults;
        !is_owed || now_ns > self.ends_ns + GRACE.as_nanos() as i64
    }
}
