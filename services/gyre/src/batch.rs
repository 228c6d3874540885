//! `gyre batch`: a run for each of many drives.

mod drive;

use std::{
    collections::BTreeMap,
    fs,
    num::NonZeroUsize,
    path::{Path, PathBuf, absolute},
    process::ExitCode,
    thread,
};

use clap::Args;
use gyre_configuration::paths::shipped;
use gyre_results::{Content, Out};
use gyre_stage::wake::Signals;
use gyre_terminal::{Failure, INTERRUPTED, print};
use gyre_tools::batch::{Ended, List, Outcome, Row, compute, table};

pub use drive::drive;

#[derive(Debug, Args)]
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
    let list = List::read(&arguments.list)?;
    let configuration = arguments.config.as_deref().map(placed).transpose()?;
    let mut list = list.with(configuration.as_deref(), &arguments.set);
    let share = arguments.task.zip(arguments.tasks);
    if let Some((task, tasks)) = share {
        list.drives = list.share(task, tasks)?;
    }
    // Tasks share the folder. A batch without tasks has it for itself, and writes the table.
    let _lock = match (arguments.collect, share) {
        (true, _) => None,
        (false, None) => Some(Out::lock_for(&arguments.out, Content::BATCH)?),
        (false, Some(_)) => {
            Content::BATCH.require_place(&arguments.out)?;
            gyre_storage::create_folder(&arguments.out)?;
            None
        }
    };
    let out = arguments.out.canonicalize();
    let out = out.map_err(|error| format!("cannot use {}: {error}", arguments.out.display()))?;
    let ended = match arguments.collect {
        true => Ended::default(),
        false => {
            let processors = thread::available_parallelism().ok();
            let jobs = arguments.jobs.or(processors).map_or(1, usize::from);
            compute(&list, &out, jobs, &Signals::install()?)?
        }
    };
    let rows = table::read(&list, &out)?;
    if share.is_none() {
        table::write(&rows, &out)?;
    }
    let mut incomplete = rows.iter().filter(|row| row.outcome != Outcome::Complete);
    if arguments.collect {
        let lines = incomplete.clone().map(|row| row.line(false));
        lines.for_each(print::note);
    }
    print::line(sentence(&rows, ended.earlier))?;
    if share.is_none() {
        let (out, results, times) = (out.display(), table::RESULTS, table::TIMES_FILE);
        print::line(format_args!("table in {out}: {results}, {times}"))?;
    }
    Ok(match (ended.interrupted, incomplete.next()) {
        (true, _) => ExitCode::from(INTERRUPTED),
        (false, None) => ExitCode::SUCCESS,
        (false, Some(_)) => ExitCode::FAILURE,
    })
}

/// Returns the absolute path of a configuration, or its path in the program.
fn placed(named: &Path) -> Result<PathBuf, Failure> {
    if let Some(own) = shipped(named) {
        return Ok(own);
    }
    let found = fs::metadata(named).and_then(|_| absolute(named));
    found.map_err(|error| {
        format!("cannot read the configuration {}: {error}", named.display()).into()
    })
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
