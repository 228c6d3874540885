//! `gyre batch`: a run for each of many drives.

use std::{
    collections::BTreeMap,
    fs,
    num::NonZeroUsize,
    path::{Path, PathBuf, absolute},
    process::ExitCode,
    thread,
    time::{Duration, Instant},
};

use clap::Args;
use gyre_configuration::{
    paths::shipped,
    terminal::{Failure, INTERRUPTED, print},
};
use gyre_results::{Content, Form, Identity, Out, OutError, SUMMARY};
use gyre_tools::batch::{End, List, Outcome, Row, compute, table};

use crate::{
    arguments::{RunArguments, resolve, results_folder},
    earlier::{self, Earlier},
    plan, run,
};

/// The run of a batch that was killed writes its results for so long, and has its folder meanwhile.
const ENDING: Duration = Duration::from_secs(60);
const LOOK: Duration = Duration::from_millis(200);

#[derive(Debug, Default, Args)]
pub struct BatchArguments {
    /// The drives: a text file with the path of a recording in each line, a CSV file with the
    /// columns drive, name, configuration and set, or a folder whose sub-folders are recordings.
    pub list: PathBuf,
    /// The folder of the batch. The files of an earlier call are kept and completed.
    #[arg(long, default_value = "out/batch")]
    pub out: PathBuf,
    /// The configuration of the drives that name none. Default: settings from each recording's
    /// format and its scans.
    #[arg(long, value_name = "FILE")]
    pub config: Option<PathBuf>,
    /// Override a key of each configuration, as in slam.kind=graph; may be repeated.
    #[arg(long = "set", value_name = "KEY=VALUE")]
    pub set: Vec<String>,
    /// Runs at once. Default: as many as there are processors, since a run alone is bounded by its
    /// slowest stage.
    #[arg(long, value_name = "N")]
    pub jobs: Option<NonZeroUsize>,
    /// Compute only the drives of this task, from 0, of those that share the list.
    #[arg(long, value_name = "I", requires = "tasks")]
    pub task: Option<usize>,
    /// The number of tasks that share the list.
    #[arg(long, value_name = "N", requires = "task")]
    pub tasks: Option<usize>,
    /// Compute nothing: write the table of the existing results.
    #[arg(long, conflicts_with = "task")]
    pub collect: bool,
}

/// Computes the drives of a list that are not complete, and writes the table. The exit code is 0 if
/// all are complete, 1 if not, and 130 after an interruption.
pub fn batch(arguments: &BatchArguments) -> Result<ExitCode, Failure> {
    rows(arguments).map(|(_, code)| code)
}

/// As [`batch`]; returns the rows of the drives too.
pub fn rows(arguments: &BatchArguments) -> Result<(Vec<Row>, ExitCode), Failure> {
    let list = List::read(&arguments.list)?;
    let configuration = arguments.config.as_deref().map(placed).transpose()?;
    let mut list = list.with(configuration.as_deref(), &arguments.set);
    let share = arguments.task.zip(arguments.tasks);
    if let Some((task, tasks)) = share {
        list.drives = list.share(task, tasks)?;
    }
    // Tasks share the folder. A batch without tasks has it for itself, and writes the table.
    let is_alone = share.is_none() && !arguments.collect;
    let lock = is_alone.then(|| Out::lock_for(&arguments.out, Content::BATCH));
    let _lock = lock.transpose()?;
    if share.is_some() {
        Content::BATCH.require_place(&arguments.out)?;
        gyre_storage::create_folder(&arguments.out)?;
    }
    let out = arguments.out.canonicalize();
    let out = out.map_err(|error| format!("cannot use {}: {error}", arguments.out.display()))?;
    if arguments.collect && !out.join("rows").is_dir() {
        let reason = "is not the folder of a batch: no drive has been computed there";
        return Err(format!("{} {reason}", out.display()).into());
    }
    let processors = thread::available_parallelism().ok();
    let jobs = arguments.jobs.or(processors).map_or(1, usize::from);
    let (earlier, interrupted) = match arguments.collect {
        true => (0, false),
        false => compute(&list, &out, jobs)?,
    };
    let drives = list.drives.iter();
    let rows: Vec<_> = drives.map(|drive| Row::read(&out, drive)).collect();
    let mut said = sentence(&rows, earlier);
    if share.is_none() {
        table::write(&rows, &out)?;
        let (out, results, times) = (out.display(), table::RESULTS, table::TIMES_FILE);
        said += &format!("\ntable in {out}: {results}, {times}");
    }
    let mut incomplete = rows.iter().filter(|row| row.outcome != Outcome::Complete);
    if arguments.collect {
        let lines = incomplete.clone().map(|row| row.line(false));
        lines.for_each(print::note);
    }
    print::line(said)?;
    let code = match (interrupted, incomplete.next()) {
        (true, _) => ExitCode::from(INTERRUPTED),
        (false, None) => ExitCode::SUCCESS,
        (false, Some(_)) => ExitCode::FAILURE,
    };
    Ok((rows, code))
}

/// Returns the absolute path of a configuration, or its path in the program.
fn placed(named: &Path) -> Result<PathBuf, Failure> {
    if let Some(own) = shipped(named) {
        return Ok(own);
    }
    let (found, shown) = (fs::metadata(named), named.display());
    let placed = found.and_then(|_| absolute(named));
    placed.map_err(|error| format!("cannot read the configuration {shown}: {error}").into())
}

fn sentence(rows: &[Row], earlier: usize) -> String {
    let mut counts = BTreeMap::new();
    for row in rows {
        *counts.entry(row.outcome).or_insert(0) += 1;
    }
    let each = counts.iter();
    let each = each.map(|(outcome, count)| format!("{count} {outcome}"));
    let each = each.collect::<Vec<_>>().join(", ");
    let earlier = match earlier {
        0 => String::new(),
        earlier => format!("; {earlier} had been computed before"),
    };
    match rows.len() {
        0 => "no drives".to_owned(),
        1 => format!("1 drive: {each}{earlier}"),
        drives => format!("{drives} drives: {each}{earlier}"),
    }
}

/// Computes a drive in a process of its own, unless it has been computed with the same
/// configuration from the same scans, and prints its end.
pub fn drive(run: &RunArguments) -> Result<ExitCode, Failure> {
    if !run.options.ends_with_parent()? {
        return Ok(ExitCode::FAILURE);
    }
    let end =
        computed(run).unwrap_or_else(|error| End::new(Outcome::Failed, false, error.to_string()));
    print::line(serde_json::to_string(&end)?)?;
    Ok(ExitCode::SUCCESS)
}

fn computed(arguments: &RunArguments) -> Result<End, Failure> {
    let unchecked = |reason: String| Ok(End::new(Outcome::Failed, true, reason));
    // The recording may have been removed since the batch began.
    let is_missing = |path: &&PathBuf| !path.exists() && shipped(path).is_none();
    if let Some(path) = arguments.inputs.what.last().filter(is_missing) {
        return unchecked(format!("there is nothing at {}", path.display()));
    }
    let configuration = resolve(arguments)?;
    if configuration.is_radar() || configuration.source.repeat {
        return Err(format!(
            "the configuration is of {}, which has no end: a batch is of recordings and simulations",
            configuration.data()
        )
        .into());
    }
    let (folder, deadline) = (results_folder(arguments)?, Instant::now() + ENDING);
    let out = loop {
        match Out::lock(&folder) {
            Err(OutError::Held(_)) if Instant::now() < deadline => thread::sleep(LOOK),
            Err(held @ OutError::Held(_)) => return unchecked(held.to_string()),
            out => break out?,
        }
    };
    // The folder is judged by the run that it is of.
    earlier::settle(&out)?;
    // By whatever build. `None`: a run reports files that cannot be read, and keeps its poses.
    let is_same = Identity::read(&out)
        .and_then(|begun| begun.has_inputs_of(&configuration, &plan::replaced(&configuration)?))
        .ok();
    let is_complete = earlier::is_complete(out.path()) && out.join(SUMMARY).exists();
    if is_complete && is_same == Some(true) {
        return Ok(End::new(Outcome::Complete, true, ""));
    }
    // A run of another configuration, build or version is discarded.
    let programs = plan::programs(&configuration)?;
    let earlier = Earlier::of(&out, &configuration, &programs, false)?;
    let is_foreign = matches!(earlier, Earlier::Foreign(_) | Earlier::Complete(_));
    let discards = is_foreign || is_same == Some(false);
    match run::compute(configuration, out, discards, Form::Table)? {
        code if code == ExitCode::from(INTERRUPTED) => Ok(End::interrupted()),
        _ => Ok(End::new(Outcome::Complete, false, "")),
    }
}
