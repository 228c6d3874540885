//! `gyre-lab tables`: Fast-MbyM's Table III for this machine, the paper's figures and a baseline's
//! beside ours.
//!
//! - [`rows`]: what is compared, and what each row overrides in a configuration;
//! - [`times`]: Table IIIa by the [`timer`], and [`baseline`] in it; Table IIIb is made of runs.

mod baseline;
pub mod rows;
mod timer;
mod times;

use std::{path::Path, process::ExitCode};

use gyre_configuration::terminal::Failure;
use serde_json::json;

use crate::{
    cli::TablesArguments,
    report::{Notes, Table, make_folder, publish, record},
    sequence::Sequence,
};
use rows::PaperTables;

/// Measures, prints and writes both tables.
pub fn tables(arguments: &TablesArguments) -> Result<ExitCode, Failure> {
    let sequences = Sequence::all(&arguments.sequences)?;
    let rows = PaperTables::read()?;
    make_folder(&arguments.out)?;
    let mut tables = vec![times::times(&rows, &sequences[0], arguments)?];
    for sequence in sequences.iter().filter(|_| !arguments.times) {
        let models = &arguments.sequences.models;
        tables.push(accuracy(&rows, sequence, models, &arguments.out)?);
    }
    publish("tables", &tables, &arguments.out)?;
    Ok(ExitCode::SUCCESS)
}

/// Runs every row of Table IIIb on `sequence`. Where the network of one is missing there is only
/// what the paper says, if it does.
fn accuracy(
    rows: &PaperTables,
    sequence: &Sequence,
    models: &Path,
    out: &Path,
) -> Result<Table, Failure> {
    let (mut records, mut left_out) = (Vec::new(), Notes::new());
    for row in rows.run() {
        let changes = row.changes(rows);
        let n = sequence.configuration(&changes)?.odometry.raster.n;
        let mut cells = record(json!({ "row": row.name }));
        cells.extend(rows.paper(row, n));
        match sequence.model(models, &row.mask, &changes)? {
            Ok(model) if row.is_measured() => {
                cells.extend(sequence.run(&row.name, &changes, model.as_ref(), out)?.1);
            }
            Ok(_) => {}
            Err(reason) => left_out
                .entry(reason)
                .or_insert_with(Vec::new)
                .push(row.name.clone()),
        }
        if cells.contains_key("command") || row.is_of_paper() {
            records.push(cells);
        }
    }
    Ok(sequence.table("IIIb: accuracy", records, left_out))
}
