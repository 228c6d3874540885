//! `gyre-lab tables`: Fast-MbyM's Table III for this machine, the paper's figures and a baseline's beside ours.
//!
//! - [`rows`]: what is compared, and what each row overrides in a configuration;
//! - [`times`]: Table IIIa, and [`baseline`] in it; Table IIIb is made of runs.

mod baseline;
pub mod rows;
mod times;

use std::{path::Path, process::ExitCode};

use gyre::Failure;
use serde::Serialize;

use crate::{
    cli::TablesArguments,
    report::{Heading, Notes, make_folder, publish},
    sequence::{Experiment, LEGEND, Line, Sequence},
};
use baseline::Baseline;
use rows::{Row, Rows, Table};
use times::Times;

/// The source of the paper's figures.
const PAPER: &str =
    "\nThe paper: Weston, Gadd, De Martini, Newman, Posner: Fast-MbyM, ICRA 2022, Table III.\n";

/// `tables.json`.
#[derive(Debug, Serialize)]
struct Tables {
    #[serde(flatten)]
    heading: Heading,
    /// Table IIIa.
    times: Times,
    /// Table IIIb, sequence by sequence.
    accuracy: Vec<Experiment>,
}

/// Measures, prints and writes both tables.
///
/// # Errors
/// A recording, run or file that fails.
pub fn tables(arguments: &TablesArguments) -> Result<ExitCode, Failure> {
    let sequences = Sequence::all(&arguments.sequences)?;
    let (out, models) = (&arguments.out, &arguments.sequences.models);
    let rows = Rows::read()?;
    make_folder(out)?;
    let baseline = arguments
        .baseline
        .as_deref()
        .zip(arguments.baseline_script.as_deref());
    let baseline = baseline.map(|(python, script)| Baseline { python, script });
    let times = Times::measure(&rows, &sequences[0], arguments, baseline)?;
    let runs: &[Sequence] = if arguments.times { &[] } else { &sequences };
    let tables = Tables {
        heading: Heading::now(),
        times,
        accuracy: runs
            .iter()
            .map(|sequence| accuracy(&rows, sequence, models, out))
            .collect::<Result<_, _>>()?,
    };
    let mut text = tables.heading.markdown("Tables") + PAPER + &tables.times.markdown();
    text.extend(tables.accuracy.iter().map(Experiment::markdown));
    if !tables.accuracy.is_empty() {
        text += LEGEND;
    }
    publish(out, "tables", &tables, &text)?;
    Ok(ExitCode::SUCCESS)
}

/// Runs every row of Table IIIb on `sequence`. Where the network of one is missing there is only what the paper says, if it does.
fn accuracy(
    rows: &Rows,
    sequence: &Sequence,
    models: &Path,
    out: &Path,
) -> Result<Experiment, Failure> {
    let (mut lines, mut left_out) = (Vec::new(), Notes::new());
    for row in rows.of(Table::Accuracy) {
        let n = sequence
            .configuration(&row.changes(rows, None))?
            .odometry
            .raster
            .n;
        let measured = match row.is_measured() {
            true => run(rows, row, sequence, models, out)?,
            false => Ok(Line::default()),
        };
        let line = measured.unwrap_or_else(|reason| {
            left_out.entry(reason).or_default().push(row.name.clone());
            Line::default()
        });
        if line.command.is_some() || row.is_of_paper() {
            let (row, paper) = (row.name.clone(), rows.figures(row, Table::Accuracy, n));
            lines.push(Line { row, paper, ..line });
        }
    }
    Ok(Experiment {
        title: "IIIb: accuracy",
        data: sequence.data.display().to_string(),
        lines,
        left_out,
    })
}

/// Runs a row; inside, why its network cannot be used.
fn run(
    rows: &Rows,
    row: &Row,
    sequence: &Sequence,
    models: &Path,
    out: &Path,
) -> Result<Result<Line, String>, Failure> {
    let model = match row.mask.is_empty() {
        true => None,
        false => match sequence.model(models, &row.mask, &row.changes(rows, None))? {
            Ok(model) => Some(model),
            Err(reason) => return Ok(Err(reason)),
        },
    };
    let (_, line) = sequence.run(&row.name, &row.changes(rows, model.as_ref()), out)?;
    Ok(Ok(Line { model, ..line }))
}
