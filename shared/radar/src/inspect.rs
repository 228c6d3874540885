//! What a dataset is, and what looks wrong with it: `gyre inspect`.

mod clock;
mod display;
mod oddities;
mod rows;
mod timing;
mod truth;

use std::path::{Path, PathBuf};

use serde::Serialize;

pub use clock::ClockOffset;
pub use rows::{Chirps, RowsReport};
pub use timing::{Gap, Stall, TimingReport};
pub use truth::TruthReport;

use crate::dataset::ImageSize;
use crate::dataset::OpenError;
use crate::dataset::{Dataset, open};
use crate::dataset::{DatasetOptions, Format};
use crate::scan::OwnedScan;
use crate::trajectory::Trajectory;

/// Pixels that are decoded at most; a longer dataset is sampled evenly. About 2 s of work.
const PIXEL_BUDGET: usize = 250_000_000;

/// What a dataset is. [`std::fmt::Display`] prints it for a reader, serde for a program.
#[derive(Clone, Debug, Serialize)]
pub struct Report {
    /// The dataset's root.
    pub root: PathBuf,
    /// The form of its files.
    pub format: Format,
    /// Scans (images).
    pub scans: usize,
    /// How many of them were read for this report, evenly over the dataset.
    pub scans_read: usize,
    /// Images as stored.
    pub image: ImageSize,
    /// Whether images are stored with range downwards.
    pub on_their_side: bool,
    /// Azimuths of a scan.
    pub azimuths: usize,
    /// Range bins of an azimuth.
    pub bins: usize,
    /// Metres a range bin.
    pub range_resolution_m: f32,
    /// Metres to add to every range.
    pub range_offset_m: f32,
    /// Range of the last bin's centre, m.
    pub max_range_m: f32,
    /// Encoder counts a turn, where azimuths come from an encoder.
    pub encoder_counts: Option<u16>,
    /// What the stamps mean, one sentence.
    pub stamp_meaning: &'static str,
    /// Times of the scans; `None` where the files are not named by times and no list gives them.
    pub timing: Option<TimingReport>,
    /// Rows of all scans read.
    pub rows: RowsReport,
    /// Scans that could not be read.
    pub unreadable: Vec<Unreadable>,
    /// Ground truth files found.
    pub truths: Vec<TruthReport>,
    /// What the reader noticed, and what looks wrong: whole sentences.
    pub oddities: Vec<String>,
}

/// A scan that could not be read.
#[derive(Clone, Debug, Serialize)]
pub struct Unreadable {
    /// Its index, from 0.
    pub scan: usize,
    /// Its file.
    pub file: PathBuf,
    /// Why.
    pub error: String,
}

/// Looks through the dataset at `root`.
///
/// With a `trajectory` whose times are the scans' (an odometry result), the clock of each ground truth with times is compared with it.
pub fn inspect(
    root: &Path,
    options: &DatasetOptions,
    trajectory: Option<&Trajectory>,
) -> Result<Report, OpenError> {
    let mut dataset = open(root, options)?;
    let timing = timing::examine(dataset.as_ref());
    let seen = read_scans(dataset.as_mut());
    let mut report = assemble(root, dataset.as_ref(), seen, timing);
    report.truths = truth::examine(root, dataset.as_ref(), trajectory);
    report.oddities = oddities::list(&report, dataset.notes(), options);
    Ok(report)
}

/// What reading the scans gave.
struct Seen {
    scans_read: usize,
    rows: RowsReport,
    unreadable: Vec<Unreadable>,
    /// The last scan that was read.
    scan: OwnedScan,
}

fn read_scans(dataset: &mut dyn Dataset) -> Seen {
    let step = (dataset.len() * dataset.limits().bytes)
        .div_ceil(PIXEL_BUDGET)
        .max(1);
    let mut scan = OwnedScan::with_limits(dataset.limits());
    let (mut survey, mut unreadable, mut scans_read) = (rows::Survey::default(), Vec::new(), 0);
    for index in (0..dataset.len()).step_by(step) {
        scans_read += 1;
        match dataset.read(index, scan.slot()) {
            Ok(geometry) => {
                scan.geometry = geometry;
                survey.add(&scan.view());
            }
            Err(error) => unreadable.push(Unreadable {
                scan: index,
                file: dataset.file(index).to_owned(),
                error: error.to_string(),
            }),
        }
    }
    Seen {
        scans_read,
        rows: survey.report(),
        unreadable,
        scan,
    }
}

fn assemble(
    root: &Path,
    dataset: &dyn Dataset,
    seen: Seen,
    timing: Option<TimingReport>,
) -> Report {
    let geometry = seen.scan.geometry;
    let max_range_m = seen.scan.view().range_m(geometry.bins as f32 - 1.0);
    Report {
        root: root.to_owned(),
        format: dataset.format(),
        scans: dataset.len(),
        scans_read: seen.scans_read,
        image: dataset.image_size(),
        on_their_side: dataset.on_their_side(),
        azimuths: geometry.azimuths,
        bins: geometry.bins,
        range_resolution_m: geometry.range_resolution_m,
        range_offset_m: geometry.range_offset_m,
        max_range_m,
        encoder_counts: dataset.encoder_counts(),
        stamp_meaning: dataset.stamp_meaning(),
        timing,
        rows: seen.rows,
        unreadable: seen.unreadable,
        truths: Vec::new(),
        oddities: Vec::new(),
    }
}
