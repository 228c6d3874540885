//! `gyre-lab realism`: compares simulated scans with real ones: statistics of each recording, and a
//! distance for each statistic.
//!
//! Sensors differ in resolution and range, so all that is compared is measured on one
//! [`RangeGrid`], the coarsest and shortest of the recordings'. Reading order:
//!
//! - [`subject`]: a recording that was named, its scans and how they moved, what the searches reach
//!   on it;
//! - [`statistics`]: measures a recording, scan by scan: [`grid`], [`histogram`], [`correlation`]
//!   and [`change`] (from a scan to the next) have a statistic each;
//! - [`comparison`]: the distances, and which of two recordings is closer.

mod change;
mod comparison;
mod correlation;
mod grid;
mod histogram;
mod sample;
mod statistics;
mod subject;
#[cfg(test)]
mod tests;

use std::process::ExitCode;

use gyre_terminal::{Failure, print};

use crate::{
    cli::RealismArguments,
    report::{make_folder, publish},
};
use grid::RangeGrid;
use subject::Subject;

/// Measures the recordings, compares them, and writes both.
pub fn realism(arguments: &RealismArguments) -> Result<ExitCode, Failure> {
    let out = &arguments.out;
    let mut subjects = Subject::all(arguments)?;
    let geometries = subjects.iter_mut().map(Subject::geometry);
    let geometries = geometries.collect::<Result<Vec<_>, _>>()?;
    let grid =
        RangeGrid::common(&geometries).ok_or("the recordings' scans have no range in common")?;
    make_folder(out)?;
    let mut measured = Vec::new();
    let mut legend = format!(
        "Powers averaged over {:.4} m of range up to {:.1} m, the coarsest and the shortest of the recordings'; saturation in the \
         sensors' own bins; within: between a recording's halves, and what is no more than that is chance.",
        grid.resolution_m,
        grid.range_m(),
    );
    for subject in &mut subjects {
        subject.search(arguments.search_scans, out)?;
        print::note(format_args!("{}: statistics", subject.role));
        let of = subject.measure(grid, arguments.scans.get())?;
        let [scans, pairs] = ["scans", "pairs"].map(|key| of.whole.figure(key).unwrap_or(0.0));
        let (role, data) = (subject.role, subject.sequence.data.display());
        legend += &format!(" {role}: {data}, {scans} scans, {pairs} pairs of consecutive ones.");
        measured.push(of);
    }
    let mut table = comparison::compare(&measured[0], &measured[1], measured.get(2))?;
    table.legend = legend + &table.legend;
    publish("realism", &[table], out)?;
    Ok(ExitCode::SUCCESS)
}
