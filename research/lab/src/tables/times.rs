//! Table IIIa: how long mask, search and refinement take for a pair of scans, as far as a row has
//! them, on one thread of this process.

use gyre_geometry::OwnedScan;
use gyre_configuration::terminal::Failure;
use serde_json::json;

use super::{
    baseline::{self, BaselineTimes},
    rows::{PaperTables, TableRow},
    timer::Timer,
};
use crate::{
    cli::TablesArguments,
    models::Model,
    report::{Column, Notes, Record, Table, record},
    sequence::Sequence,
};

/// Scans of the sequence whose searches are timed, in turn.
const SCANS: usize = 8;

const COLUMNS: [Column; 10] = [
    ("n", "n", 0),
    ("cell_m", "cell m", 2),
    ("row", "row", 0),
    ("ms", "ms", 3),
    ("hz", "Hz", 1),
    ("baseline_ms", "baseline ms", 2),
    ("baseline_ratio", "baseline / ours", 1),
    ("paper_laptop_hz", "paper Hz, laptop", 1),
    ("paper_jetson_hz", "paper Hz, Jetson", 1),
    ("mask", "mask", 0),
];

/// A row at one size; `None` without the network for it.
type Timed<'a> = (&'a TableRow, Option<Timer>);

/// Times all rows at all sizes on scans of `sequence`: half the passes, then the baseline, then the
/// other half.
///
/// # Errors
/// A row that cannot be timed at a size, or what the baseline says.
pub fn times(
    rows: &PaperTables,
    sequence: &Sequence,
    arguments: &TablesArguments,
) -> Result<Table, Failure> {
    let scans = sequence.open()?.first_scans(SCANS);
    if scans.len() < 2 {
        let data = sequence.data.display();
        return Err(format!("{data} has no two scans that can be read").into());
    }
    let mut left_out = Notes::new();
    let timers = |n: &usize| timers(rows, sequence, *n, arguments, &scans, &mut left_out);
    let timers = arguments.sizes.iter().map(timers);
    let timers = timers.collect::<Result<Vec<_>, _>>()?;
    let (mut records, mut torch) = (Vec::new(), None);
    for (n, mut timers) in arguments.sizes.iter().copied().zip(timers) {
        time(&mut timers, arguments)?;
        let baseline = baseline::time(sequence, n, arguments)?;
        time(&mut timers, arguments)?;
        let cells = |(row, timer)| cells(rows.paper(row, n), n, row, timer, baseline.as_ref());
        records.extend(timers.into_iter().map(cells));
        torch = baseline.map(|baseline| baseline.torch);
    }
    Ok(Table {
        title: format!(
            "IIIa: time of a search, on scans of {}",
            sequence.data.display()
        ),
        columns: COLUMNS.to_vec(),
        rows: records,
        left_out,
        legend: legend(2 * arguments.passes.get(), scans.len(), torch),
    })
}

fn time(timers: &mut [Timed<'_>], arguments: &TablesArguments) -> Result<(), Failure> {
    let mut timers = timers.iter_mut().filter_map(|(_, timer)| timer.as_mut());
    timers.try_for_each(|timer| timer.time(arguments.passes.get()))
}

/// The rows at one size. Where the network of one is missing there is only what the paper and the
/// baseline say, if they do.
fn timers<'a>(
    rows: &'a PaperTables,
    sequence: &Sequence,
    n: usize,
    arguments: &TablesArguments,
    scans: &[OwnedScan],
    left_out: &mut Notes,
) -> Result<Vec<Timed<'a>>, Failure> {
    let mut timers = Vec::new();
    for row in rows.timed() {
        match Model::find(&arguments.sequences.models, &row.mask, n, None) {
            Ok(model) => {
                let mut changes = row.changes(rows);
                changes.extend(model.iter().flat_map(Model::changes));
                let configuration = sequence.configuration(&changes)?;
                let timer = Timer::new(configuration, model, !row.mask_alone, n, scans);
                let failed = |reason| format!("{} at {n} cells a side: {reason}", row.name);
                timers.push((row, Some(timer.map_err(failed)?)));
            }
            Err(reason) => {
                let rows = left_out.entry(reason).or_default();
                rows.push(format!("{} at {n}", row.name));
                timers.extend(row.is_of_paper().then_some((row, None)));
            }
        }
    }
    Ok(timers)
}

fn cells(
    paper: Record,
    n: usize,
    row: &TableRow,
    timer: Option<Timer>,
    baseline: Option<&BaselineTimes>,
) -> Record {
    let ms = timer.as_ref().map(Timer::median_ms);
    let of_row = row.baseline.as_ref();
    let baseline_ms = of_row.and_then(|row| baseline?.median_ms(n, row));
    let mut cells = record(json!({
        "n": n,
        "row": row.name,
        "cell_m": timer.as_ref().map(|timer| timer.cell_m),
        "ms": ms,
        "hz": ms.map(|ms| 1e3 / ms),
        "baseline_ms": baseline_ms,
        "baseline_ratio": ms.zip(baseline_ms).map(|(ours, theirs)| theirs / ours),
        "mask": timer.and_then(|timer| timer.model).map(|model| model.card),
    }));
    cells.extend(paper);
    cells
}

fn legend(passes: usize, scans: usize, torch: Option<String>) -> String {
    let baseline = torch.map_or_else(String::new, |torch| {
        format!(
            " Baseline: PyTorch {torch}, one thread, on noise, its median, between the two halves of the passes; it transforms both \
             scans of each pair and tries as many angles."
        )
    });
    format!(
        "ms: for a scan, one thread, median of {passes} passes over {scans} scans, the earlier scan's spectrum kept as in a run (not \
         where a mask looks at both), rasters and points ready. The rows that mask include the mask; mask: that alone. The rows that \
         refine do so at every size with the same points.{baseline} Paper: Weston, Gadd, De Martini, Newman, Posner: Fast-MbyM, ICRA \
         2022, Table III; a Core i7 at 2.9 GHz, a Jetson Nano with its GPU. -: not given there, or not there here."
    )
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use serde_json::Value;

    use super::*;

    #[test]
    fn a_row_without_its_network_has_the_baselines_and_the_papers_figures() {
        let rows = PaperTables::read().unwrap();
        let text = r#"{"torch": "2.4", "rows": [{"n": 255, "row": "f-raw", "median_ms": 20.0}]}"#;
        let baseline: BaselineTimes = serde_json::from_str(text).unwrap();
        let row = rows.named("f-raw, line 14").unwrap();
        let found = cells(rows.paper(row, 255), 255, row, None, Some(&baseline));
        let expected = [
            ("n", json!(255)),
            ("ms", Value::Null),
            ("baseline_ms", json!(20.0)),
            ("baseline_ratio", Value::Null),
            ("paper_laptop_hz", json!(58.2)),
            ("paper_jetson_hz", json!(22.3)),
        ];
        for (key, value) in expected {
            assert_eq!(found[key], value, "{key}");
        }
    }
}
