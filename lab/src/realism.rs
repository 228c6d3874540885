//! `gyre-lab realism`: how like real scans simulated ones are: statistics of each recording, and a distance for each statistic.
//!
//! Sensors differ in resolution and range, so all that is compared is measured on one [`RangeGrid`], the coarsest and shortest of
//! the recordings'. Reading order:
//!
//! - [`recording`]: a recording that was named, its scans and how they moved; [`odometry`]: what the searches reach on it;
//! - [`meter`]: [`Meter`] takes scans one after the other, a line a statistic;
//! - [`grid`]: the common grid of range, and scans brought onto it;
//! - [`histogram`], [`ranges`]: how strong powers are, overall and range by range;
//! - [`correlation`]: over which distance they are alike;
//! - [`streaks`]: azimuths that are bright over their whole length;
//! - [`change`]: what differs between a scan and the next;
//! - [`statistics`]: all of that for one recording;
//! - [`comparison`]: the distances, and which of two recordings is closer;
//! - [`plot`]: the curves of several recordings as SVG; [`markdown`]: the tables as text.

mod change;
mod comparison;
mod correlation;
mod grid;
mod histogram;
mod markdown;
mod meter;
mod odometry;
mod plot;
mod ranges;
mod recording;
mod statistics;
mod streaks;
#[cfg(test)]
mod tests;

use std::{
    fs,
    path::{Path, PathBuf},
    process::ExitCode,
};

use gyre_masking::MaskingConfig;
use serde::Serialize;

use gyre::{Failure, picture::Picture, print};

use crate::cli::RealismArguments;
use change::{Change, ChangeMeter};
use comparison::{Comparison, compare};
use correlation::Curve;
use grid::{RangeGrid, Resampler};
use histogram::Histogram;
use meter::{Meter, MeterConfig};
use odometry::Searches;
use plot::curves;
use ranges::PowerByRange;
use recording::{Aligned, Source};
use statistics::{Measured, Recording, ScanStatistics, SearchErrors};
use streaks::Streaks;

/// Cells of the rasters in which consecutive scans are compared, and pixels of the pictures, m.
const CELL_M: f32 = 0.4;

/// All of it: `realism.json`.
#[derive(Debug, Serialize)]
struct Report {
    version: &'static str,
    /// The grid that all were measured on.
    grid: RangeGrid,
    /// The cells in which consecutive scans were compared, m.
    cell_m: f32,
    /// The simulated, the real and the other real recording.
    subjects: Vec<Subject>,
    /// What they make of each other.
    comparison: Comparison,
}

/// A recording and how it was measured.
#[derive(Debug, Serialize)]
struct Subject {
    /// `sim`, `real` or `other`.
    role: &'static str,
    /// Its folder.
    data: PathBuf,
    /// Its configuration; `None`: the one that ships for its format.
    configuration: Option<PathBuf>,
    /// Whose motions aligned its consecutive scans.
    aligned: Aligned,
    /// What it is like.
    measured: Measured,
}

/// Measures the recordings, compares them, and writes tables, plots and pictures.
pub fn realism(arguments: &RealismArguments) -> Result<ExitCode, Failure> {
    let out = &arguments.out;
    let mut sources = sources(arguments)?;
    let geometries = sources
        .iter_mut()
        .map(|source| Ok(source.first_scan()?.geometry));
    let geometries = geometries.collect::<Result<Vec<_>, Failure>>()?;
    let grid =
        RangeGrid::common(&geometries).ok_or("the recordings' scans have no range in common")?;
    let threshold = arguments
        .threshold
        .unwrap_or(MaskingConfig::default().threshold);
    let config = MeterConfig {
        grid,
        threshold,
        cell_m: CELL_M,
    };
    let subjects = sources
        .iter_mut()
        .map(|source| measure(source, config, arguments));
    let subjects = subjects.collect::<Result<Vec<_>, Failure>>()?;
    let recordings: Vec<&Recording> = subjects
        .iter()
        .map(|subject| &subject.measured.whole)
        .collect();
    for (name, svg) in curves(&recordings)? {
        save(&out.join(format!("{name}.svg")), &svg)?;
    }
    let comparison = compare(
        &subjects[0].measured,
        &subjects[1].measured,
        subjects.get(2).map(|other| &other.measured),
    );
    let report = Report {
        version: env!("CARGO_PKG_VERSION"),
        grid,
        cell_m: CELL_M,
        subjects,
        comparison,
    };
    let text = markdown::of(&report);
    save(
        &out.join("realism.json"),
        &serde_json::to_string_pretty(&report)?,
    )?;
    save(&out.join("realism.md"), &text)?;
    print::line(text.trim_end())?;
    Ok(ExitCode::SUCCESS)
}

/// The recordings that were named, each with a folder of its own for what is run on it.
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

fn measure(
    source: &mut Source,
    config: MeterConfig,
    arguments: &RealismArguments,
) -> Result<Subject, Failure> {
    let searches = Searches::run(source, arguments.search_scans)?;
    print::note(format_args!("{}: statistics", source.role));
    draw(source, &arguments.out)?;
    let (measured, aligned) = source.measure(config, arguments.scans.get(), &searches)?;
    let configuration = source.configuration_file.clone();
    Ok(Subject {
        role: source.role,
        data: source.data.clone(),
        configuration,
        aligned,
        measured,
    })
}

/// One scan for the eye, from above and as measured.
fn draw(source: &mut Source, out: &Path) -> Result<(), Failure> {
    let scan = source.middle_scan()?;
    let path = |what: &str| out.join(format!("{}{what}.png", source.role));
    Picture::from_above(&scan.view(), CELL_M)?.write(&path(""))?;
    Ok(Picture::as_measured(&scan.view()).write(&path("-as-measured"))?)
}

fn save(path: &Path, text: &str) -> Result<(), Failure> {
    fs::write(path, text)
        .map_err(|error| format!("cannot write {}: {error}", path.display()).into())
}
