//! `gyre batch`: a run for each of many drives.

mod drive;

use std::{
    collections::BTreeMap,
    fs,
    path::{Path, PathBuf, absolute},
    process::ExitCode,
    thread,
};

use gyre_batch::{
    Batch, DriveOutcome, Ended, List, Settings, Slice, Table, collect, compute, table,
};
use gyre_configuration::paths::shipped;
use gyre_results::{Content, Out};
use gyre_stage::wake::Signals;
use gyre_terminal::{Failure, INTERRUPTED, own, print};

use crate::cli::BatchArguments;

pub use drive::drive;

/// Computes the drives of a list that are not complete, and writes the table. The exit code is 0 if
/// all are complete, 1 if not, and 130 after an interruption.
pub fn batch(arguments: &BatchArguments) -> Result<ExitCode, Failure> {
    let list = List::read(&arguments.list)?;
    let settings = settings(arguments)?;
    let slice = arguments.task.zip(arguments.tasks);
    let slice = slice.map(|(task, tasks)| Slice { task, tasks });
    if arguments.collect {
        let out = existing(&arguments.out)?;
        let table = written(&list, &settings, &out)?;
        table.failures().for_each(print::note);
        return concluded(&table.counts(), 0, &out, false);
    }
    // Tasks share the folder. Alone, this one has it for itself, and writes the table.
    Content::BATCH.require_place(&arguments.out)?;
    let lock = slice
        .is_none()
        .then(|| Out::lock_for(&arguments.out, Content::BATCH));
    let _lock = lock.transpose()?;
    fs::create_dir_all(&arguments.out)
        .map_err(|error| format!("cannot write to {}: {error}", arguments.out.display()))?;
    let out = existing(&arguments.out)?;
    let batch = Batch {
        program: own(),
        list: &list,
        drives: match slice {
            Some(slice) => list.slice(slice)?,
            None => list.drives().to_vec(),
        },
        settings: settings.clone(),
        out: out.clone(),
        jobs: arguments.jobs.map_or_else(jobs, usize::from),
    };
    let ended = compute(&batch, &Signals::install()?, &mut |line| print::note(line))?;
    let Ended {
        counts,
        earlier,
        interrupted,
    } = ended;
    if slice.is_some() {
        print::line(sentence(&counts, earlier))?;
        return Ok(exit_code(&counts, interrupted));
    }
    match written(&list, &settings, &out) {
        Ok(table) => concluded(&table.counts(), earlier, &out, interrupted),
        Err(error) if DriveOutcome::of_full(&error.to_string()).is_some() => {
            print::note(format_args!("gyre: there is no table: {error}"));
            print::line(sentence(&counts, earlier))?;
            Ok(match interrupted {
                true => ExitCode::from(INTERRUPTED),
                false => ExitCode::FAILURE,
            })
        }
        Err(error) => Err(error),
    }
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

fn existing(out: &Path) -> Result<PathBuf, Failure> {
    let unusable = |error| format!("cannot use {}: {error}", out.display());
    Ok(out.canonicalize().map_err(unusable)?)
}

/// As many runs as processors: one alone is bounded by its slowest stage and leaves time unused.
fn jobs() -> usize {
    thread::available_parallelism().map_or(1, usize::from)
}

/// Writes the table, and reports if several builds computed it.
fn written(list: &List, settings: &Settings, out: &Path) -> Result<Table, Failure> {
    let table = collect(list, settings, out)?;
    table.write(out)?;
    if let builds @ [_, _, ..] = &table.builds()[..] {
        print::note(format_args!(
            "the results are of {} builds of gyre: {}; those in drives/ that are removed are computed anew",
            builds.len(),
            builds.join(", ")
        ));
    }
    Ok(table)
}

fn concluded(
    counts: &BTreeMap<DriveOutcome, usize>,
    earlier: usize,
    out: &Path,
    interrupted: bool,
) -> Result<ExitCode, Failure> {
    print::line(format_args!(
        "{}\ntable in {}: {}, {}",
        sentence(counts, earlier),
        out.display(),
        table::RESULTS,
        table::TIMES
    ))?;
    Ok(exit_code(counts, interrupted))
}

/// The number of drives by outcome, in a sentence.
fn sentence(counts: &BTreeMap<DriveOutcome, usize>, earlier: usize) -> String {
    let drives: usize = counts.values().sum();
    let each = counts
        .iter()
        .map(|(outcome, count)| format!("{count} {outcome}"));
    let each: Vec<_> = each.collect();
    let earlier = match earlier {
        0 => String::new(),
        earlier => format!("; {earlier} had been computed before"),
    };
    let each = each.join(", ");
    match drives {
        0 => "no drives".to_owned(),
        1 => format!("1 drive: {each}{earlier}"),
        _ => format!("{drives} drives: {each}{earlier}"),
    }
}

fn exit_code(counts: &BTreeMap<DriveOutcome, usize>, interrupted: bool) -> ExitCode {
    let is_whole = counts
        .keys()
        .all(|outcome| *outcome == DriveOutcome::Complete);
    match (interrupted, is_whole) {
        (true, _) => ExitCode::from(INTERRUPTED),
        (false, true) => ExitCode::SUCCESS,
        (false, false) => ExitCode::FAILURE,
    }
}
