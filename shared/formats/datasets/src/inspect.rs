//! Summary of a dataset and of its faults: `gyre inspect`.

mod display;
mod findings;
mod gnss;
mod ground_truth;
mod gyro;
mod rows;
mod times;
mod timing;
mod velocity;
mod wheels;

use std::path::{Path, PathBuf};

use serde::Serialize;

pub use gnss::GnssReport;
pub use ground_truth::GroundTruthReport;
pub use gyro::{GyroReport, QuietReport};
pub use rows::{Chirps, RowsReport};
pub use times::LogTimes;
pub use timing::{Gap, Stall, TimingReport};
pub use velocity::VelocityReport;
pub use wheels::WheelReport;

use crate::dataset::ImageSize;
use crate::dataset::OpenError;
use crate::dataset::{Dataset, open};
use crate::dataset::{DatasetOptions, Format};
use gyre_radar::scan::OwnedScan;
use gyre_radar::trajectory::Trajectory;

/// Maximum number of pixels to decode, about 2 s; longer datasets are subsampled.
const PIXEL_BUDGET: usize = 250_000_000;

/// Summary of a dataset: [`std::fmt::Display`] prints it, serde serialises it.
#[derive(Clone, Debug, Serialize)]
pub struct Report {
    /// Root of the dataset.
    pub root: PathBuf,
    /// File format.
    pub format: Format,
    /// Number of scans.
    pub scans: usize,
    /// Number of scans read for this report, spread over the dataset.
    pub scans_read: usize,
    /// Size of the images as stored.
    pub image: ImageSize,
    /// True if images are stored as range x azimuth.
    pub transposed: bool,
    /// Azimuths of the scan with most of them.
    pub azimuths: usize,
    /// Range bins per azimuth.
    pub bins: usize,
    /// Depth of a range bin, m.
    pub range_resolution_m: f32,
    /// Offset of the ranges, m.
    pub range_offset_m: f32,
    /// Range of the centre of the last bin, m.
    pub max_range_m: f32,
    /// Encoder counts per turn, if azimuths come from an encoder.
    pub encoder_counts: Option<u16>,
    /// Definition of the stamps, one sentence.
    pub stamp_meaning: &'static str,
    /// Times of the scans; `None` if neither the file names nor a list give them.
    pub timing: Option<TimingReport>,
    /// Rows of the scans read.
    pub rows: RowsReport,
    /// The velocity of the radar by the Doppler shift of the last scan read; `None` where chirps do
    /// not alternate.
    pub velocity: Option<VelocityReport>,
    /// Scans that could not be read.
    pub unreadable: Vec<Unreadable>,
    /// Ground truth files found.
    pub ground_truths: Vec<GroundTruthReport>,
    /// The log of a gyro beside the scans.
    pub gyro: Option<GyroReport>,
    /// The log of the wheels beside the scans.
    pub wheels: Option<WheelReport>,
    /// The fixes of a GNSS receiver in the bag, else its log beside the scans.
    pub gnss: Option<GnssReport>,
    /// Observations of the reader and faults: whole sentences.
    pub findings: Vec<String>,
}

/// A scan that could not be read.
#[derive(Clone, Debug, Serialize)]
pub struct Unreadable {
    /// Index, from 0.
    pub scan: usize,
    /// File.
    pub file: PathBuf,
    /// Cause.
    pub error: String,
}

/// Examines the dataset at `root`.
///
/// With a `trajectory` of the dataset (an odometry result), the clock of each stamped ground truth
/// is compared with it.
///
/// # Errors
/// A dataset that cannot be opened; see [`open`].
pub fn inspect(
    root: &Path,
    options: &DatasetOptions,
    trajectory: Option<&Trajectory>,
) -> Result<Report, OpenError> {
    let dataset = open(root, options)?;
    let logs = InspectedLogs::default();
    Ok(inspect_dataset(root, dataset, options, &logs, trajectory))
}

/// Settings by which the logs beside the scans are read.
#[derive(Clone, Debug, Default)]
pub struct InspectedLogs {
    /// The topic of GNSS in a bag, else the only one.
    pub gnss_topic: Option<String>,
    /// Distance of one tick of the wheels, m.
    pub m_per_tick: Option<f64>,
}

/// Examines an open dataset, which was opened at `root` with `options`.
pub fn inspect_dataset(
    root: &Path,
    mut dataset: Box<dyn Dataset>,
    options: &DatasetOptions,
    logs: &InspectedLogs,
    trajectory: Option<&Trajectory>,
) -> Report {
    let timing = timing::examine(dataset.as_ref());
    let read = read_scans(dataset.as_mut());
    let mut report = assemble(root, dataset.as_ref(), read, timing);
    report.ground_truths = ground_truth::examine(root, dataset.as_ref(), trajectory);
    report.gyro = gyro::examine(root, report.timing.as_ref());
    report.wheels = wheels::examine(root, logs.m_per_tick, report.timing.as_ref());
    let topic = logs.gnss_topic.as_deref();
    report.gnss = gnss::examine(root, dataset.as_mut(), topic, report.timing.as_ref());
    report.findings = findings::list(&report, dataset.notes(), options);
    report
}

/// Results of reading the scans.
struct ScansRead {
    scans_read: usize,
    rows: RowsReport,
    unreadable: Vec<Unreadable>,
    /// The last scan.
    scan: OwnedScan,
}

fn read_scans(dataset: &mut dyn Dataset) -> ScansRead {
    let step = (dataset.len() * dataset.limits().bytes)
        .div_ceil(PIXEL_BUDGET)
        .max(1);
    let mut scan = OwnedScan::with_limits(dataset.limits());
    let (mut survey, mut unreadable, mut scans_read) = (rows::Survey::default(), Vec::new(), 0);
    for index in (dataset.first()..dataset.len()).step_by(step) {
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
    ScansRead {
        scans_read,
        rows: survey.report(),
        unreadable,
        scan,
    }
}

fn assemble(
    root: &Path,
    dataset: &dyn Dataset,
    read: ScansRead,
    timing: Option<TimingReport>,
) -> Report {
    let geometry = read.scan.geometry;
    let max_range_m = read.scan.view().range_m(geometry.bins as f32 - 1.0);
    Report {
        root: root.to_owned(),
        format: dataset.format(),
        scans: dataset.len(),
        scans_read: read.scans_read,
        image: dataset.image_size(),
        transposed: dataset.is_transposed(),
        azimuths: read.rows.in_scan.1,
        bins: geometry.bins,
        range_resolution_m: geometry.range_resolution_m,
        range_offset_m: geometry.range_offset_m,
        max_range_m,
        encoder_counts: dataset.encoder_counts(),
        stamp_meaning: dataset.stamp_meaning(),
        timing,
        rows: read.rows,
        velocity: velocity::examine(&read.scan.view()),
        unreadable: read.unreadable,
        ground_truths: Vec::new(),
        gyro: None,
        wheels: None,
        gnss: None,
        findings: Vec::new(),
    }
}
