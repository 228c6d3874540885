//! One run from its start to its end, with what is done to it, as an observer of `pose` sees it.

use std::{
    collections::BTreeMap,
    fs::{self, File},
    path::{Path, PathBuf},
    process::{Child, Stdio},
    sync::atomic::{AtomicUsize, Ordering},
    thread,
    time::{Duration, Instant},
};

use gyre_messages::{Footprint, Pose, PoseHeader, StageId};
use gyre_stage::{
    clock,
    observer::{Next, ObservedRun, Observer},
};
use rustix::process::{Pid, Signal, kill_process};
use serde::Deserialize;

use crate::{
    StressError,
    campaign::Subject,
    fault::{Fault, FaultKind, Faults},
    helper::{self, Helper},
    processes::{Cost, Sampler},
    record::{Recorded, Recorder},
    scenario::Scenario,
};

/// Poses before the measurement: buffers grow, and memory is touched for the first time.
const WARM_UP: u64 = 8;
/// Time for a run to make its first poses. It may load a model.
const START_LIMIT: Duration = Duration::from_secs(300);
/// Time after the measurement in which late poses still count.
const GRACE: Duration = Duration::from_secs(10);
/// Time for a run to write its results.
const END_LIMIT: Duration = Duration::from_secs(120);
/// Time between two looks at a run that starts or ends.
const LOOK: Duration = Duration::from_millis(20);
/// Time between two looks at faults and processes.
const TICK: Duration = Duration::from_millis(20);
const SAMPLE_EVERY: Duration = Duration::from_secs(1);

/// A run, and what is done to it.
#[derive(Clone, Debug)]
pub struct Setup {
    /// The scenario.
    pub scenario: Scenario,
    /// The name of its folder.
    pub name: String,
    /// Scans a second.
    pub rate_hz: f64,
    /// Time that is measured.
    pub duration: Duration,
    /// Overrides of the configuration, `section.key=value`.
    pub set: Vec<String>,
    /// Scans that become due at once.
    pub burst: u64,
    /// Helpers that load the machine while it is measured.
    pub loads: Vec<Vec<String>>,
    /// Programs that read all topics.
    pub observers: usize,
    /// What happens to these stages.
    pub faults: Option<(FaultKind, Vec<StageId>)>,
    /// For the choice of faults.
    pub seed: u64,
}

impl Setup {
    /// Returns a run that nothing is done to.
    pub fn undisturbed(scenario: Scenario, rate_hz: f64, duration: Duration) -> Self {
        Self {
            scenario,
            name: scenario.name().to_owned(),
            rate_hz,
            duration,
            set: Vec::new(),
            burst: 1,
            loads: Vec::new(),
            observers: 0,
            faults: None,
            seed: 0,
        }
    }
}

/// What was measured of a run.
#[derive(Clone, Debug)]
pub struct Measured {
    /// Latency and counts.
    pub recorded: Recorded,
    /// What was done to its stages.
    pub faults: Vec<Fault>,
    /// What its processes used.
    pub processes: Vec<Cost>,
    /// Its shared memory, bytes.
    pub shared_bytes: u64,
    /// What it says of itself.
    pub summary: Summary,
    /// Why it ended although it was still measured.
    pub died: Option<String>,
}

/// What is read of `summary.json`.
#[derive(Clone, Debug, Default, Deserialize)]
#[serde(default)]
pub struct Summary {
    /// Restarts by stage.
    pub restarts: BTreeMap<String, usize>,
    /// Counters by stage.
    pub stages: BTreeMap<String, Counters>,
}

/// The counters of a stage that are of interest here.
#[derive(Clone, Copy, Debug, Default, Deserialize)]
#[serde(default)]
pub struct Counters {
    /// Wake-ups that the transport lost and that were caught late.
    pub wakes_caught_late: u64,
}

/// Lets pipelines that are measured together wait for each other after their warm-up.
#[derive(Debug)]
pub struct Gate {
    expected: usize,
    arrived: AtomicUsize,
}

impl Gate {
    /// A gate for so many pipelines.
    pub fn of(expected: usize) -> Self {
        Self {
            expected,
            arrived: AtomicUsize::new(0),
        }
    }

    fn arrive(&self) {
        self.arrived.fetch_add(1, Ordering::SeqCst);
    }

    fn is_open(&self) -> bool {
        self.arrived.load(Ordering::SeqCst) >= self.expected
    }
}

/// Arrives at the gate at its end at the latest: nobody waits for a pipeline that has failed.
struct Ticket<'a> {
    gate: &'a Gate,
    has_arrived: bool,
}

impl Ticket<'_> {
    fn arrive(&mut self) {
        if !std::mem::replace(&mut self.has_arrived, true) {
            self.gate.arrive();
        }
    }
}

impl Drop for Ticket<'_> {
    fn drop(&mut self) {
        self.arrive();
    }
}

/// Starts a run, measures it, and ends it.
///
/// # Errors
/// A run that makes no first poses; a helper that fails.
pub fn measure(subject: &Subject, setup: &Setup, gate: &Gate) -> Result<Measured, StressError> {
    let mut ticket = Ticket {
        gate,
        has_arrived: false,
    };
    let mut run = Running::start(subject, setup)?;
    let deadline = Instant::now() + START_LIMIT;
    let observed = run.attach(deadline)?;
    let mut poses = observed.observe::<Pose>()?;
    let mut newest = run.warm_up(&mut poses, deadline)?;
    let loads = run.load(subject)?;
    ticket.arrive();
    loop {
        drain(&mut poses, TICK, &mut |pose| newest = *pose)?;
        if gate.is_open() {
            break;
        }
    }
    let mut session = Session::begin(setup, run.pid(), &newest);
    while !session.is_over() {
        let has_ended = drain(&mut poses, TICK, &mut |pose| session.add(pose))?;
        session.look();
        if has_ended || run.has_ended() {
            break;
        }
    }
    let died = run.has_ended().then(|| run.last_words());
    drop(loads);
    let processes = session.processes.costs();
    let recorded = session.recorder.finish(session.period_ns, clock::now_ns());
    let faults = session.faults.map(Faults::finish).unwrap_or_default();
    let manifest = observed.manifest();
    let shared_bytes = Footprint::new(&manifest.window, &manifest.limits).total() as u64;
    drop(poses);
    drop(observed);
    Ok(Measured {
        recorded,
        faults,
        processes,
        shared_bytes,
        summary: run.end(),
        died,
    })
}

/// Takes the poses that come within `limit`; true if the run has ended.
fn drain(
    poses: &mut Observer<'_, Pose>,
    limit: Duration,
    take: &mut dyn FnMut(&PoseHeader),
) -> Result<bool, StressError> {
    let mut limit = limit;
    loop {
        match poses.next(limit)? {
            Next::Message(pose, _) => take(pose.header()),
            Next::Idle => return Ok(false),
            Next::Ended => return Ok(true),
        }
        limit = Duration::ZERO;
    }
}

/// What is measured, from the first scan after the warm-up on.
struct Session {
    recorder: Recorder,
    processes: Sampler,
    faults: Option<Faults>,
    period_ns: i64,
    ends_ns: i64,
    sampled: Instant,
}

impl Session {
    /// Begins now; `newest` is the last pose of the warm-up.
    fn begin(setup: &Setup, supervisor: u32, newest: &PoseHeader) -> Self {
        let began_ns = clock::now_ns();
        let ends_ns = began_ns + setup.duration.as_nanos() as i64;
        let faults = setup
            .faults
            .clone()
            .map(|(kind, stages)| Faults::new(kind, stages, setup.seed, began_ns, setup.duration));
        let mut recorder = Recorder::new(began_ns..ends_ns, setup.burst);
        recorder.add(newest);
        Self {
            recorder,
            processes: Sampler::new(supervisor),
            faults,
            period_ns: (1e9 / setup.rate_hz) as i64,
            ends_ns,
            sampled: Instant::now(),
        }
    }

    fn add(&mut self, pose: &PoseHeader) {
        self.recorder.add(pose);
        if let Some(faults) = &mut self.faults {
            faults.pose(pose);
        }
    }

    fn look(&mut self) {
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
        let has_all = !self.recorder.owes(self.period_ns);
        let has_recovered = self.faults.as_ref().is_none_or(|faults| !faults.are_open());
        (has_all && has_recovered) || now_ns > self.ends_ns + GRACE.as_nanos() as i64
    }
}

/// A run as a child process. It is ended when this is dropped.
struct Running<'a> {
    setup: &'a Setup,
    process: Child,
    out: PathBuf,
    log: PathBuf,
}

impl<'a> Running<'a> {
    fn start(subject: &Subject, setup: &'a Setup) -> Result<Self, StressError> {
        let runs = subject.out.join("runs");
        fs::create_dir_all(&runs).map_err(StressError::file(&runs))?;
        let (out, log) = (
            runs.join(&setup.name),
            runs.join(format!("{}.txt", setup.name)),
        );
        let output = File::create(&log).map_err(StressError::file(&log))?;
        let errors = output.try_clone().map_err(StressError::file(&log))?;
        let words = words(subject, setup, &out);
        let mut command = helper::command(&subject.program, &words);
        command.stdin(Stdio::null()).stdout(output).stderr(errors);
        let process = command.spawn().map_err(|source| StressError::Start {
            program: subject.program.display().to_string(),
            source,
        })?;
        Ok(Self {
            setup,
            process,
            out,
            log,
        })
    }

    fn pid(&self) -> u32 {
        self.process.id()
    }

    fn has_ended(&mut self) -> bool {
        !matches!(self.process.try_wait(), Ok(None))
    }

    fn last_words(&self) -> String {
        let said = fs::read_to_string(&self.log).unwrap_or_default();
        let last = said.lines().rfind(|line| !line.trim().is_empty());
        last.unwrap_or("it said nothing").to_owned()
    }

    /// Waits until the run can be observed.
    fn attach(&mut self, deadline: Instant) -> Result<ObservedRun, StressError> {
        loop {
            if let Ok(run) = ObservedRun::writing_to(&self.out)
                && run.observe::<Pose>().is_ok()
            {
                return Ok(run);
            }
            self.require_life(deadline)?;
            thread::sleep(LOOK);
        }
    }

    fn require_life(&mut self, deadline: Instant) -> Result<(), StressError> {
        if self.has_ended() {
            return Err(StressError::EndedEarly {
                scenario: self.setup.name.clone(),
                said: self.last_words(),
            });
        }
        match Instant::now() < deadline {
            true => Ok(()),
            false => Err(StressError::NoPose {
                scenario: self.setup.name.clone(),
                limit_s: START_LIMIT.as_secs(),
                log: self.log.clone(),
            }),
        }
    }

    /// Waits for the first poses, and returns the newest of them; where hardly a scan comes, for one.
    fn warm_up(
        &mut self,
        poses: &mut Observer<'_, Pose>,
        deadline: Instant,
    ) -> Result<PoseHeader, StressError> {
        let enough = match self.setup.scenario {
            Scenario::Idle => 1,
            _ => WARM_UP,
        };
        let (mut count, mut newest) = (0, PoseHeader::default());
        while count < enough {
            let ended = drain(poses, TICK, &mut |pose| {
                count += 1;
                newest = *pose;
            })?;
            if ended {
                // What it says is complete when it has ended.
                let _ = self.process.wait();
            }
            self.require_life(deadline)?;
        }
        Ok(newest)
    }

    fn load(&self, subject: &Subject) -> Result<Vec<Helper>, StressError> {
        let observe = ["observe".to_owned(), self.out.display().to_string()];
        let observers = (0..self.setup.observers).map(|_| observe.to_vec());
        let loads = self.setup.loads.iter().cloned().chain(observers);
        loads
            .map(|work| Helper::start(&subject.program, &work))
            .collect()
    }

    /// Ends the run and reads what it says of itself.
    fn end(mut self) -> Summary {
        self.stop();
        let summary = fs::read_to_string(self.out.join("summary.json"));
        let summary = summary
            .ok()
            .and_then(|text| serde_json::from_str(&text).ok());
        summary.unwrap_or_default()
    }

    fn stop(&mut self) {
        if let Some(pid) = Pid::from_raw(self.process.id() as i32)
            && !self.has_ended()
        {
            let _ = kill_process(pid, Signal::TERM);
        }
        let deadline = Instant::now() + END_LIMIT;
        while !self.has_ended() && Instant::now() < deadline {
            thread::sleep(LOOK);
        }
        let _ = self.process.kill();
        let _ = self.process.wait();
    }
}

impl Drop for Running<'_> {
    fn drop(&mut self) {
        self.stop();
    }
}

/// The words of the helper that becomes the run.
fn words(subject: &Subject, setup: &Setup, out: &Path) -> Vec<String> {
    // Relative to the sensor's own pace.
    let rate = (setup.rate_hz * subject.period.as_secs_f64()).clamp(0.001, 1000.0);
    let configuration = subject.configuration.display().to_string();
    let out = out.display().to_string();
    let rate = rate.to_string();
    let fixed = [
        "run",
        "run",
        &configuration,
        "--fresh",
        "--out",
        &out,
        "--rate",
        &rate,
        "--set",
        "run.mode=live",
        "--set",
        "source.repeat=true",
    ];
    let set = setup.set.iter().flat_map(|sentence| ["--set", sentence]);
    fixed.into_iter().chain(set).map(str::to_owned).collect()
}
