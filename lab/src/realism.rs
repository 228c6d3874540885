//! `gyre-lab realism`: compares simulated scans with real ones: statistics of each recording, and a distance for each statistic.
//!
//! Sensors differ in resolution and range, so all that is compared is measured on one [`RangeGrid`], the coarsest and shortest of
//! the recordings'. Reading order:
//!
//! - [`recording`]: a recording that was named, its scans and how they moved, what the searches reach on it;
//! - [`statistics`]: measures a recording, scan by scan: [`grid`], [`histogram`], [`correlation`], [`streaks`] (azimuths that are bright
//!   over their whole length) and [`change`] (from a scan to the next) have a statistic each;
//! - [`comparison`]: the distances, and which of two recordings is closer.

mod change;
mod comparison;
mod correlation;
mod grid;
mod histogram;
mod recording;
mod statistics;
mod streaks;
#[cfg(test)]
mod tests;

use std::{path::PathBuf, process::ExitCode};

use gyre::{Failure, print};
use gyre_masking::MaskingConfig;
use serde::Serialize;

use crate::{
    cli::RealismArguments,
    report::{make_folder, number, or_dash, publish, table},
};
use comparison::{Comparison, Row, compare};
use grid::RangeGrid;
use recording::{Measured, Source};
use statistics::MeterConfig;

/// Cells of the rasters in which consecutive scans are compared, m.
const CELL_M: f32 = 0.4;

/// `realism.json`.
#[derive(Debug, Serialize)]
struct Report {
    version: &'static str,
    /// The grid that all were measured on.
    grid: RangeGrid,
    /// The cells in which consecutive scans were compared, m.
    cell_m: f32,
    /// The simulated, the real and the other real recording.
    subjects: Vec<Subject>,
    /// The distances.
    comparison: Comparison,
}

/// A recording and what was measured of it.
#[derive(Debug, Serialize)]
struct Subject {
    /// `sim`, `real` or `other`.
    role: &'static str,
    /// The recording's folder.
    data: PathBuf,
    measured: Measured,
}

/// Measures the recordings, compares them, and writes both.
///
/// # Errors
/// A recording, run or file that fails.
pub fn realism(arguments: &RealismArguments) -> Result<ExitCode, Failure> {
    let out = &arguments.out;
    let mut sources = sources(arguments)?;
    let geometries = sources
        .iter_mut()
        .map(|source| Ok(source.first_scan()?.geometry));
    let geometries = geometries.collect::<Result<Vec<_>, Failure>>()?;
    let grid =
        RangeGrid::common(&geometries).ok_or("the recordings' scans have no range in common")?;
    let config = MeterConfig {
        grid,
        threshold: arguments
            .threshold
            .unwrap_or(MaskingConfig::default().threshold),
        cell_m: CELL_M,
    };
    make_folder(out)?;
    let mut subjects = Vec::new();
    for source in &mut sources {
        source.search(arguments.search_scans, out)?;
        print::note(format_args!("{}: statistics", source.role));
        subjects.push(Subject {
            role: source.role,
            data: source.data.clone(),
            measured: source.measure(config, arguments.scans.get())?,
        });
    }
    let other = subjects.get(2).map(|other| &other.measured);
    let comparison = compare(&subjects[0].measured, &subjects[1].measured, other);
    let report = Report {
        version: env!("CARGO_PKG_VERSION"),
        grid,
        cell_m: CELL_M,
        subjects,
        comparison,
    };
    publish(out, "realism", &report, &report.markdown())?;
    Ok(ExitCode::SUCCESS)
}

/// Opens the recordings that were named.
fn sources(arguments: &RealismArguments) -> Result<Vec<Source>, Failure> {
    let named = [
        ("sim", Some(&arguments.sim), &arguments.sim_config),
        ("real", Some(&arguments.real), &arguments.real_config),
        (
            "other",
            arguments.between.as_ref(),
            &arguments.between_config,
        ),
    ];
    let open = |(role, data, configuration): (&'static str, Option<&PathBuf>, &Option<PathBuf>)| {
        data.map(|data| Source::open(role, data, configuration.as_deref(), &arguments.out))
    };
    named.into_iter().filter_map(open).collect()
}

impl Report {
    fn markdown(&self) -> String {
        let subjects = self.subjects.iter();
        let names =
            subjects.map(|subject| format!("{}: {}", subject.role, subject.measured.whole.name));
        let mut header = vec!["statistic".to_owned()];
        header.extend(names);
        header.extend(["distance", "within real", "sim-real"].map(str::to_owned));
        let between = self.subjects.len() > 2;
        let others = ["real-other", "within other", "sim is"].map(str::to_owned);
        header.extend(others.into_iter().filter(|_| between));
        let rows = self
            .comparison
            .rows
            .iter()
            .map(|row| cells(row, self.subjects.len()));
        let verdict = format!(
            "\ncloser in {} of {}\n",
            self.comparison.closer, self.comparison.judged
        );
        format!(
            "# Realism\n\nPowers averaged over {:.4} m of range up to {:.1} m, the coarsest and the shortest of the recordings'; saturation \
             in the sensors' own bins; consecutive scans compared in cells of {} m; `within` is between a recording's halves, \
             and what is no more than that is chance.\n\n{}{}",
            self.grid.resolution_m,
            self.grid.range_m(),
            self.cell_m,
            table(&header, rows),
            if between { &verdict } else { "" }
        )
    }
}

fn cells(row: &Row, recordings: usize) -> Vec<String> {
    let verdict = match row.closer {
        None => "-",
        Some(true) => "closer",
        Some(false) if row.is_within_chance() => "farther, within chance",
        Some(false) => "farther",
    };
    let mut cells = vec![row.statistic.to_owned()];
    cells.extend(
        row.values
            .iter()
            .take(recordings)
            .map(|value| or_dash(value.as_ref())),
    );
    cells.extend([
        row.distance.to_owned(),
        number(row.within_real, 3),
        number(row.sim_real, 3),
    ]);
    let others = [
        number(row.real_other, 3),
        number(row.within_other, 3),
        verdict.to_owned(),
    ];
    cells.extend(others.into_iter().filter(|_| recordings > 2));
    cells
}
