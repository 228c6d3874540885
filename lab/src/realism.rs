//! `gyre-lab realism`: how close simulated scans are to real ones: statistics of each recording, and a distance for each statistic.
//!
//! Sensors differ in resolution and range, so all that is compared is measured on one [`RangeGrid`], the coarsest and shortest of
//! the recordings'. Reading order:
//!
//! - [`recording`]: a recording that was named, its scans and how they moved, what the searches reach on it;
//! - [`statistics`]: measures a recording, scan by scan: [`grid`], [`histogram`], [`correlation`], [`streaks`] (azimuths that are bright
//!   over their whole length) and [`change`] (from a scan to the next) have a statistic each;
//! - [`comparison`]: the distances, and which of two recordings is closer;
//! - [`plot`]: the curves of several recordings as SVG; [`markdown`]: the tables as text.

mod change;
mod comparison;
mod correlation;
mod grid;
mod histogram;
mod markdown;
mod plot;
mod recording;
mod statistics;
mod streaks;
#[cfg(test)]
mod tests;

use std::{
    path::{Path, PathBuf},
    process::ExitCode,
};

use gyre::{Failure, picture::Picture, print};
use gyre_masking::MaskingConfig;
use serde::Serialize;

use crate::{
    cli::RealismArguments,
    report::{make_folder, publish, save},
};
use comparison::{Comparison, compare};
use grid::RangeGrid;
use recording::{Measured, Recording, Source};
use statistics::MeterConfig;

/// Cells of the rasters in which consecutive scans are compared, and pixels of the pictures, m.
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
    /// Its folder.
    data: PathBuf,
    measured: Measured,
}

/// Measures the recordings, compares them, and writes tables, plots and pictures.
///
/// # Errors
/// What cannot be read, run or written.
pub fn realism(arguments: &RealismArguments) -> Result<ExitCode, Failure> {
    let out = &arguments.out;
    let mut sources = sources(arguments)?;
    let geometries = sources
        .iter_mut()
        .map(|source| Ok(source.scan(false)?.geometry));
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
        draw(source, out)?;
        subjects.push(Subject {
            role: source.role,
            data: source.data.clone(),
            measured: source.measure(config, arguments.scans.get())?,
        });
    }
    let recordings: Vec<&Recording> = subjects
        .iter()
        .map(|subject| &subject.measured.whole)
        .collect();
    for (name, svg) in plot::curves(&recordings)? {
        save(&out.join(format!("{name}.svg")), &svg)?;
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
    publish(out, "realism", &report, &markdown::of(&report))?;
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

/// Draws the scan half-way through from above and as measured.
fn draw(source: &mut Source, out: &Path) -> Result<(), Failure> {
    let scan = source.scan(true)?;
    let path = |what: &str| out.join(format!("{}{what}.png", source.role));
    Picture::from_above(&scan.view(), CELL_M)?.write(&path(""))?;
    Ok(Picture::as_measured(&scan.view()).write(&path("-as-measured"))?)
}
