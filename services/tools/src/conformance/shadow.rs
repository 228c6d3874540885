//! `gyre shadow`: a second program for a stage of a running run. It gets the same inputs as the
//! stage, its results are compared with the stage's and timed, and nobody uses them.
//!
//! To the run this process is an observer ([`gyre_client::observer`]): the run neither waits for it
//! nor fails with it. The program gets the observed items one at a time. The only cost for the
//! observed run is processor time.

mod observation;
mod record;
mod renumbering;
mod shadowing;

use std::{
    fs,
    io::{self, Write},
    path::{Path, PathBuf},
    process::ExitCode,
    time::{Duration, Instant},
};

use clap::Args;
use gyre_client::{Manifest, Run, RunError, Signals, control::Control};
use gyre_configuration::terminal::{Failure, own, print, seconds, words};
use gyre_contract::{
    FollowerId, Footprint, StageId, Window,
    run::{REFINEMENT_STATE, StageConfig},
};
use gyre_results::{Content, Out};
use gyre_supervise::{Scheduling, SuperviseError, rig::Process};

use crate::{
    conformance::{
        Candidate,
        harness::{Harness, Sent},
    },
    doctor::check_shared_memory,
    operate::{RunChoice, chosen},
};

pub use record::{Beside, Counts, Report, Verdict};

use record::Record;
use shadowing::Shadowing;

/// Messages that are taken at once of a program that may send without end.
const AT_ONCE: usize = 64;
/// Time to exit after SIGTERM, as in a run.
const STOP_TIMEOUT: Duration = Duration::from_secs(2);
/// Time between two polls of a process that is to exit.
const POLL_PERIOD: Duration = Duration::from_millis(5);

#[derive(Debug, Args)]
pub struct ShadowArguments {
    /// The stage: masking, rotation-search, translation-search, joint-search or refinement.
    pub stage: String,
    #[command(flatten)]
    pub run: RunChoice,
    /// The program and its arguments, as in 'python3 stage.py --fast'; no shell is involved.
    /// Default: Gyre's own stage.
    #[arg(long, value_name = "COMMAND")]
    pub command: Option<String>,
    /// File of Python with a function in the place of a program: see docs/replace-a-stage.md.
    #[arg(long, value_name = "FILE", conflicts_with = "command")]
    pub python: Option<PathBuf>,
    /// Items to compare. Default: until the run ends.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(1..))]
    pub scans: Option<u64>,
    /// Write shadow.json, shadow.csv with a row for each item, and the program's output,
    /// shadow.txt, to this folder.
    #[arg(long, value_name = "DIR")]
    pub report: Option<PathBuf>,
    /// Niceness of the program, -20 to 19: the run goes first.
    #[arg(long, default_value_t = 10, value_parser = clap::value_parser!(i32).range(-20..=19))]
    pub nice: i32,
    /// Time for the program to open its topics, s.
    #[arg(long, default_value = "30", value_name = "S", value_parser = seconds)]
    pub start_timeout_s: Duration,
    /// Time for the program to answer an item, s.
    #[arg(long, default_value = "10", value_name = "S", value_parser = seconds)]
    pub patience_s: Duration,
    /// Print JSON instead of a table.
    #[arg(long)]
    pub json: bool,
}

impl ShadowArguments {
    fn command(&self, stage: StageId) -> Result<Vec<String>, Failure> {
        let (gyre, python) = (own(), self.python.as_deref());
        match &self.command {
            Some(command) => words(command),
            None => Ok(StageConfig::own_command(
                &gyre.to_string_lossy(),
                stage.name(),
                python,
            )),
        }
    }
}

/// The exit code is 1 if nothing was compared, or the program died, hung or broke the contract.
pub fn shadow(arguments: &ShadowArguments) -> Result<ExitCode, Failure> {
    let stage = stage(&arguments.stage)?;
    let command = arguments.command(stage)?;
    let folder = arguments.report.as_deref();
    let locked = folder.map(|folder| Out::lock_for(folder, Content::SHADOW));
    let _locked = locked.transpose()?;
    let control = chosen(&arguments.run)?;
    require_stage(&control, stage)?;
    let run = Run::open(control.out())?;
    let manifest = run.manifest();
    let window = Window {
        observers: 0,
        ..manifest.window
    };
    check_shared_memory(&Footprint::new(&window, &manifest.limits))?;
    let report = compare(&run, stage, command, arguments)?;
    match arguments.json {
        true => print::line(serde_json::to_string_pretty(&report)?)?,
        false => print::line(&report)?,
    }
    Ok(match report.is_sound() {
        true => ExitCode::SUCCESS,
        false => ExitCode::FAILURE,
    })
}

fn stage(name: &str) -> Result<StageId, Failure> {
    let stages: Vec<&str> = StageId::between().map(StageId::name).collect();
    let stages = stages.join(", ");
    let stage = StageId::by_name(name);
    if let Some(stage) = StageId::between().find(|it| Some(*it) == stage) {
        return Ok(stage);
    }
    let reason = match stage {
        Some(StageId::RadarReplay) => "is a source, which has no inputs",
        Some(_) => "adds up all motions since the start of the run and owns its journal",
        None if FollowerId::by_name(name).is_some() => "reads the run's logs and no topics",
        None => {
            return Err(
                format!("there is no stage `{name}`; these can have a shadow: {stages}").into(),
            );
        }
    };
    Err(format!("{name} cannot have a shadow, since it {reason}; these can: {stages}").into())
}

/// Requires that the run has the stage: joint-search stands in the place of the other two searches.
fn require_stage(control: &Control, stage: StageId) -> Result<(), Failure> {
    let processes = control.status()?.processes;
    let names: Vec<_> = processes.iter().map(|it| it.name.as_str()).collect();
    let (stage, list) = (stage.name(), names.join(", "));
    match names.contains(&stage) {
        true => Ok(()),
        false => Err(format!("the run has no {stage}; it has {list}").into()),
    }
}

/// Compares until the run ends, a limit is reached, or a signal requests a stop. Faults of the
/// program are in the report, not in the error.
fn compare(
    run: &Run,
    stage: StageId,
    command: Vec<String>,
    arguments: &ShadowArguments,
) -> Result<Report, Failure> {
    let signals = Signals::install()?;
    let in_report = |name| arguments.report.as_ref().map(|folder| folder.join(name));
    let folder = tempfile::Builder::new().prefix("gyre-shadow-").tempdir();
    let folder = folder.map_err(RunError::file(&std::env::temp_dir()))?;
    let program = ShadowProgram {
        candidate: candidate(run, stage, command, arguments.nice)?,
        folder: folder.path().to_owned(),
        output: in_report("shadow.txt"),
    };
    if let Some(path) = &program.output {
        fs::write(path, "").map_err(RunError::file(path))?;
    }
    let topic = program.candidate.topics().output;
    let record = Record::new(stage, topic, in_report("shadow.csv").as_deref())?;
    let record = Shadowing::begin(arguments, &program, run, &signals, record)?.run()?;
    let report = Report::of(&program.candidate, &record);
    if let Some(path) = in_report("shadow.json") {
        let text = serde_json::to_string_pretty(&report);
        let text = text.map_err(|error| format!("cannot write shadow.json: {error}"))?;
        fs::write(&path, text).map_err(RunError::file(&path))?;
    }
    Ok(report)
}

/// Returns the program, in a run like the observed one but lossless: the scans that the run's
/// masking has dropped are not sent at all.
fn candidate(
    run: &Run,
    stage: StageId,
    command: Vec<String>,
    nice: i32,
) -> Result<Candidate, RunError> {
    let manifest = run.manifest();
    let configuration = manifest.root.join("config.toml");
    Ok(Candidate {
        stage,
        command,
        scheduling: Scheduling {
            nice: Some(nice),
            ..Scheduling::default()
        },
        manifest: Manifest {
            live: false,
            window: Window {
                live_depth: 0,
                observers: 0,
                ..manifest.window
            },
            ..manifest.clone()
        },
        configuration: fs::read_to_string(&configuration)
            .map_err(RunError::file(&configuration))?,
    })
}

pub(crate) struct ShadowProgram {
    /// The program; its manifest is the manifest of the observed run, without its live mode.
    pub candidate: Candidate,
    /// The place for the files of all lives.
    pub folder: PathBuf,
    pub output: Option<PathBuf>,
}

/// One life of the shadow: its process, alone in a run of its own.
pub(crate) struct Life<'a> {
    pub harness: Harness<'a>,
    pub began: Instant,
    pub is_open: bool,
}

impl<'a> Life<'a> {
    /// Starts the program in a run of its own, with a copy of the state of the observed run's
    /// refinement.
    pub fn begin(program: &'a ShadowProgram, signals: &'a Signals) -> Result<Self, SuperviseError> {
        let (candidate, out) = (&program.candidate, program.folder.join("out"));
        if out.exists() {
            fs::remove_dir_all(&out).map_err(RunError::file(&out))?;
        }
        if candidate.stage == StageId::Refinement {
            copy_state(&candidate.manifest.out, &out)?;
        }
        let rig = candidate.rig(out, signals)?;
        let mut harness = Harness::open(rig, candidate)?;
        harness.start(false)?;
        Ok(Self {
            harness,
            began: Instant::now(),
            is_open: false,
        })
    }

    /// Answers the handshakes of the process. Returns whether it has opened its topics.
    pub(crate) fn attend(&mut self) -> Result<bool, RunError> {
        self.harness.answer_handshakes()?;
        if !self.is_open && self.harness.has_publisher() {
            self.is_open = true;
            self.harness.connect()?;
        }
        Ok(self.is_open)
    }

    pub(crate) fn take(&self) -> Result<Vec<Sent>, RunError> {
        let received = std::iter::from_fn(|| self.harness.receive().transpose());
        received.take(AT_ONCE).collect()
    }

    pub(crate) fn end(&mut self) -> Result<(), RunError> {
        self.harness.process.iter().for_each(Process::terminate);
        let since = Instant::now();
        while self.harness.death().is_none() && since.elapsed() < STOP_TIMEOUT {
            std::thread::sleep(POLL_PERIOD);
            self.attend()?;
        }
        Ok(())
    }
}

impl ShadowProgram {
    /// Appends the output of a life of the program to the file for it.
    pub(crate) fn keep_output(&self, life: &Life<'_>) -> Result<(), RunError> {
        let Some(path) = &self.output else {
            return Ok(());
        };
        let log = format!("log/{}.txt", self.candidate.stage.name());
        let appended = fs::read(life.harness.rig.manifest().out.join(log)).and_then(|printed| {
            let file = fs::OpenOptions::new().create(true).append(true).open(path);
            file?.write_all(&printed)
        });
        appended.map_err(RunError::file(path))
    }
}

/// Copies the state of a run's refinement: a refinement that is restarted or swapped in starts with
/// the same state.
fn copy_state(run: &Path, out: &Path) -> Result<(), RunError> {
    let [from, to] = [run, out].map(|folder| folder.join(REFINEMENT_STATE));
    gyre_storage::create_folder(to.parent().unwrap_or(out))?;
    match fs::copy(&from, to) {
        // A replaced refinement need not have one.
        Err(error) if error.kind() != io::ErrorKind::NotFound => Err(RunError::file(&from)(error)),
        _ => Ok(()),
    }
}
