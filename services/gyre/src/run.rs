//! `gyre run`: prepares a run, supervises it, writes its results.

use std::{
    env, fs, io,
    os::unix::process::CommandExt,
    path::{Path, PathBuf},
    process::{Command, ExitCode},
    time::{Duration, Instant},
};

use gyre_messages::{StageId, flag};
use gyre_pose_integration::journal;
use gyre_refinement::checkpoint;
use gyre_stage::{
    Manifest,
    run::{RootError, RunRoot},
    supervise::{Ending, Plan, SuperviseError, supervise},
    wake::Signals,
};

use crate::{
    Failure,
    cli::RunArguments,
    configuration::{Configuration, Mode},
    preflight, print,
    progress::Progress,
    results, simulate,
    summary::Session,
};

/// The exit code of an interrupted program, as shells have it.
const INTERRUPTED: u8 = 130;

/// Runs the pipeline and writes its results, however it ended.
///
/// # Errors
/// A run that cannot start, fails, or finds fewer than two readable scans.
pub fn run(arguments: &RunArguments) -> Result<ExitCode, Failure> {
    let out = results_directory(arguments)?;
    let configuration = resolve(arguments, &out)?;
    let checked = preflight::check(&configuration)?;
    let signals = Signals::install()?;
    let root = match RunRoot::acquire(&out, &signals) {
        Err(RootError::Interrupted) => return Ok(ExitCode::from(INTERRUPTED)),
        root => root?,
    };
    preflight::check_shared_memory(&checked.footprint)?;
    let resumed = prepare(&configuration, &out, arguments.fresh)?;
    if let Some(truth) = &checked.truth {
        write(&out.join(results::SIMULATED_TRUTH), truth)?;
    }
    let manifest = Manifest {
        prefix: root.prefix(),
        root: root.path().to_owned(),
        out: out.clone(),
        window: checked.window,
        limits: checked.limits,
        live: configuration.run.mode == Mode::Live,
        refines: configuration.has(StageId::Refinement),
        rate: configuration.run.rate.factor(),
    };
    let resolved = configuration.to_toml()?;
    write(&out.join("config.toml"), &resolved)?;
    manifest.write(&resolved)?;

    let plan = Plan {
        manifest,
        stages: configuration.stage_plans(&env::current_exe()?),
        stall_timeout: limit(configuration.run.stall_timeout_s),
        start_timeout: limit(configuration.run.start_timeout_s),
    };
    let mut progress = Progress::new(checked.scans, resumed, &checked.footprint);
    let started = Instant::now();
    let report = supervise(&plan, signals, &mut |event| progress.show(&event));
    progress.finish();
    if let Err(SuperviseError::TransportStuck) = report {
        drop(root);
        return start_over();
    }
    let session = Session {
        scans: checked.scans,
        resumed,
        wall: started.elapsed(),
        footprint: &checked.footprint,
    };
    // The run keeps its lock until its results are written, so that no other run writes them meanwhile.
    finish(&configuration, &out, &session, report)
}

/// Writes the results first, so that nothing is lost, then reports a failure of the run.
fn finish(
    configuration: &Configuration,
    out: &Path,
    session: &Session<'_>,
    report: Result<gyre_stage::supervise::Report, SuperviseError>,
) -> Result<ExitCode, Failure> {
    let poses = journal::read(&journal::path(out))?;
    let summary = results::write(configuration, out, session, &poses, report.as_ref().ok());
    let report = report.map_err(|failure| match poses.len() {
        0 => failure.to_string(),
        kept => format!(
            "{failure}; {kept} poses are kept in {}, the same command resumes from there",
            out.display()
        ),
    })?;
    let read = poses.iter().filter(|pose| !pose.item.is(flag::END)).count();
    if report.ending == Ending::Complete && read < 2 {
        return Err(format!(
            "only {read} of the {} scans of {} can be read, and a motion is between two: {} says what is wrong with them",
            session.scans,
            configuration.data(),
            out.join("log.jsonl").display()
        )
        .into());
    }
    let summary = summary?;
    print::line(&summary)?;
    let counts = summary.counts();
    if report.ending == Ending::Complete && counts.too_many_are_unreadable() {
        return Err(format!(
            "{} of the {} scans of {} cannot be read: the results are of the others, and {} says what is wrong with each",
            counts.unreadable,
            session.scans,
            configuration.data(),
            out.join("log.jsonl").display()
        )
        .into());
    }
    Ok(match report.ending {
        Ending::Complete => ExitCode::SUCCESS,
        Ending::Interrupted => ExitCode::from(INTERRUPTED),
    })
}

/// `None`: no limit.
fn limit(seconds: f64) -> Option<Duration> {
    Duration::try_from_secs_f64(seconds)
        .ok()
        .filter(|limit| !limit.is_zero())
}

fn results_directory(arguments: &RunArguments) -> Result<PathBuf, Failure> {
    let name = arguments.configuration.file_stem().unwrap_or_default();
    let out = arguments
        .out
        .clone()
        .unwrap_or_else(|| Path::new("out").join(name));
    fs::create_dir_all(out.join("log"))
        .map_err(|error| format!("cannot write to {}: {error}", out.display()))?;
    Ok(out.canonicalize()?)
}

/// Returns the configuration with the overrides of the command line; a simulation that is to be stored is written.
fn resolve(arguments: &RunArguments, out: &Path) -> Result<Configuration, Failure> {
    let mut configuration = Configuration::read(&arguments.configuration, &overrides(arguments))?;
    if arguments.data.is_some() {
        configuration.simulation = None;
    }
    if let Some(simulation) = &mut configuration.simulation {
        if let Some(file) = &mut simulation.drive.file {
            *file = file.canonicalize().unwrap_or_else(|_| file.clone());
        }
        // The constants of a simulated radar are known.
        configuration.dataset = configuration.dataset.or(&simulation.dataset_options());
        configuration.source.data = match simulation.output.store {
            true => simulate::store(simulation, &out.join("recording"))?,
            false => PathBuf::new(),
        };
    }
    configuration.odometry.masking.resolve()?;
    preflight::warn_of_training(&configuration)?;
    // Absolute, so that the resolved configuration repeats the run from any folder. The reader reports what does not exist.
    for path in [
        Some(&mut configuration.source.data),
        configuration.run.ground_truth.as_mut(),
    ]
    .into_iter()
    .flatten()
    {
        if let Ok(absolute) = path.canonicalize() {
            *path = absolute;
        }
    }
    Ok(configuration)
}

fn overrides(arguments: &RunArguments) -> Vec<String> {
    // Quoted, because a folder may be named 2019-01-10 or 7.
    let quoted = |data: &PathBuf| toml::Value::from(data.to_string_lossy().into_owned());
    let data = arguments
        .data
        .iter()
        .map(|data| format!("source.data={}", quoted(data)));
    let rate = arguments
        .rate
        .iter()
        .map(|rate| format!("run.rate='{rate}'"));
    arguments
        .set
        .iter()
        .cloned()
        .chain(data)
        .chain(rate)
        .collect()
}

/// The last result to be written: it marks a run as complete.
const LAST_RESULT: &str = "summary.json";
/// The results of an earlier run, which a new one removes.
const RESULTS: [&str; 9] = [
    LAST_RESULT,
    results::SIMULATED_TRUTH,
    "log.jsonl",
    "latency.json",
    "odometry.csv",
    "trajectory.tum",
    "trajectory.svg",
    "errors.svg",
    "bands.svg",
];

fn remove(path: &Path) -> Result<(), Failure> {
    match fs::remove_file(path) {
        Err(error) if error.kind() != io::ErrorKind::NotFound => {
            Err(format!("cannot remove {}: {error}", path.display()).into())
        }
        _ => Ok(()),
    }
}

/// Resumes an unfinished run of the same configuration, else starts a new one; returns the number of poses in the journal.
fn prepare(configuration: &Configuration, out: &Path, fresh: bool) -> Result<usize, Failure> {
    let journal = journal::path(out);
    let poses = journal::read(&journal)?;
    let ended = poses.last().is_some_and(|last| last.item.is(flag::END));
    let complete = ended && out.join(LAST_RESULT).exists();
    if poses.is_empty() || complete || fresh {
        // A journal that stays would be resumed.
        for state in [journal, checkpoint::path(out)] {
            remove(&state)?;
        }
        // A new run may not write all of them: none of the earlier ones must be taken for its own.
        for result in RESULTS {
            remove(&out.join(result))?;
        }
        return Ok(0);
    }
    let same = fs::read_to_string(out.join("config.toml"))
        .ok()
        .and_then(|text| text.parse::<toml::Table>().ok())
        .is_some_and(|begun| configuration.continues(&begun));
    match same {
        true => Ok(poses.len()),
        false => Err(format!(
            "{} holds an unfinished run of another configuration ({} poses): choose another --out, or discard it with --fresh",
            out.display(),
            poses.len()
        )
        .into()),
    }
}

/// Executes the same command again: the transport hung on what a dead process left, which is removed now, and the run resumes from
/// the journal.
fn start_over() -> Result<ExitCode, Failure> {
    print::note(
        "gyre: the transport did not finish cleaning up after a dead process; starting over from the journal",
    );
    let failed = Command::new(env::current_exe()?)
        .args(env::args_os().skip(1).filter(|a| a != "--fresh"))
        .exec();
    Err(format!("cannot start over: {failed}").into())
}

fn write(path: &Path, text: impl AsRef<[u8]>) -> Result<(), Failure> {
    fs::write(path, text)
        .map_err(|error| format!("cannot write {}: {error}", path.display()).into())
}
