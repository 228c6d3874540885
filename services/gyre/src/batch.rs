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
use gyre_terminal::{Failure, INTERRUPTED, own, print};
use gyre_tools::batch::{Batch, Ended, List, Outcome, Settings, compute, table};

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
    let settings = settings(arguments)?;
    let share = arguments.task.zip(arguments.tasks);
    let out = |out: &Path| {
        let found = out.canonicalize();
        found.map_err(|error| format!("cannot use {}: {error}", out.display()))
    };
    if arguments.collect {
        let out = out(&arguments.out)?;
        let mut ended = Ended::default();
        for row in table::write(&list, &settings, &out)? {
            *ended.counts.entry(row.outcome).or_default() += 1;
            if row.outcome != Outcome::Complete {
                print::note(row.line(false));
            }
        }
        return concluded(&ended, Some(&out));
    }
    // Tasks share the folder. A batch without tasks has it for itself, and writes the table.
    Content::BATCH.require_place(&arguments.out)?;
    let _lock = match share {
        None => Some(Out::lock_for(&arguments.out, Content::BATCH)?),
        Some(_) => None,
    };
    gyre_storage::create_folder(&arguments.out)?;
    let batch = Batch {
        program: own(),
        list: &list,
        drives: match share {
            Some((task, tasks)) => list.share(task, tasks)?,
            None => list.drives.clone(),
        },
        settings,
        out: out(&arguments.out)?,
        // A run alone is bounded by its slowest stage and leaves time unused.
        jobs: arguments.jobs.map_or_else(processors, usize::from),
    };
    let ended = compute(&batch, &Signals::install()?, &mut |line| print::note(line))?;
    if share.is_some() {
        return concluded(&ended, None);
    }
    table::write(&list, &batch.settings, &batch.out)?;
    concluded(&ended, Some(&batch.out))
}

fn settings(arguments: &BatchArguments) -> Result<Settings, Failure> {
    let unread =
        |path: &Path, error| format!("cannot read the configuration {}: {error}", path.display());
    let configuration = arguments.config.as_deref().map(|path| {
        if let Some(own) = shipped(path) {
            return Ok(own);
        }
        fs::metadata(path).map_err(|error| unread(path, error))?;
        absolute(path).map_err(|error| unread(path, error))
    });
    Ok(Settings {
        configuration: configuration.transpose()?,
        set: arguments.set.clone(),
    })
}

fn processors() -> usize {
    thread::available_parallelism().map_or(1, usize::from)
}

fn concluded(ended: &Ended, table: Option<&Path>) -> Result<ExitCode, Failure> {
    print::line(sentence(&ended.counts, ended.earlier))?;
    if let Some(out) = table {
        let (out, results, times) = (out.display(), table::RESULTS, table::TIMES_FILE);
        print::line(format_args!("table in {out}: {results}, {times}"))?;
    }
    let mut outcomes = ended.counts.keys();
    let is_whole = outcomes.all(|outcome| *outcome == Outcome::Complete);
    Ok(match (ended.interrupted, is_whole) {
        (true, _) => ExitCode::from(INTERRUPTED),
        (false, true) => ExitCode::SUCCESS,
        (false, false) => ExitCode::FAILURE,
    })
}

fn sentence(counts: &BTreeMap<Outcome, usize>, earlier: usize) -> String {
    let drives: usize = counts.values().sum();
    let each = counts.iter();
    let each = each.map(|(outcome, count)| format!("{count} {outcome}"));
    let each = each.collect::<Vec<_>>().join(", ");
    let earlier = match earlier {
        0 => String::new(),
        earlier => format!("; {earlier} had been computed before"),
    };
    match drives {
        0 => "no drives".to_owned(),
        1 => format!("1 drive: {each}{earlier}"),
        _ => format!("{drives} drives: {each}{earlier}"),
    }
}
