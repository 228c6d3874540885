//! Summary of a dataset and of its faults: `gyre inspect`. Each part of the inspection adds its
//! figures, its printed lines and its findings to the [`Report`].

mod ground_truth;
mod logs;
mod rows;
mod timing;

use std::{
    fmt,
    path::{Path, PathBuf},
};

use gyre_geometry::{PolarScan, scan::OwnedScan};
use gyre_radar::{DopplerEstimator, NoDoppler, PointsConfig};
use serde::Serialize;
use serde_json::{Map, Value, json};

use crate::dataset::{Dataset, DatasetOptions, Format, OpenError, open};

/// Maximum number of pixels to decode, about 2 s; longer datasets are subsampled.
const PIXEL_BUDGET: usize = 250_000_000;
/// Maximum number of scans that are listed; more are counted.
const MAX_LISTED: usize = 8;

/// Summary of a dataset: [`std::fmt::Display`] prints it, serde serialises its figures.
#[derive(Clone, Debug, Serialize)]
pub struct Report {
    pub root: PathBuf,
    pub format: Format,
    pub scans: usize,
    /// All other figures, by their names in JSON.
    #[serde(flatten)]
    pub figures: Map<String, Value>,
    /// Observations of the reader and faults: whole sentences.
    pub findings: Vec<String>,
    #[serde(skip)]
    lines: Vec<(String, String)>,
}

/// Examines the dataset at `root`.
pub fn inspect(root: &Path, options: &DatasetOptions) -> Result<Report, OpenError> {
    let dataset = open(root, options)?;
    let logs = InspectedLogs::default();
    Ok(inspect_dataset(root, dataset, options, &logs))
}

#[derive(Clone, Debug, Default)]
pub struct InspectedLogs {
    /// The topic of GNSS in a bag, else the only one.
    pub gnss_topic: Option<String>,
    /// Distance of one tick of the wheels, m.
    pub m_per_tick: Option<f64>,
}

pub fn inspect_dataset(
    root: &Path,
    mut dataset: Box<dyn Dataset>,
    options: &DatasetOptions,
    logs: &InspectedLogs,
) -> Report {
    let dataset = dataset.as_mut();
    let mut report = Report {
        root: root.to_owned(),
        format: dataset.format(),
        scans: dataset.len(),
        figures: Map::new(),
        findings: dataset.notes().to_vec(),
        lines: Vec::new(),
    };
    let timing = timing::examine(dataset);
    let read = ScansRead::of(dataset);
    read.images(&mut report, dataset, options);
    read.rows.lines(&mut report, dataset.encoder_counts());
    velocity(&mut report, &read.scan.view());
    match &timing {
        Some(timing) => timing.add_to(&mut report),
        None => report.find(
            "The files are not named by times: scans have only the times of their rows.".to_owned(),
        ),
    }
    report.figure("timing", &timing);
    report.line("stamps", dataset.stamp_meaning().to_owned());
    report.figure("stamp_meaning", dataset.stamp_meaning());
    read.rows
        .findings(&mut report, read.scans_read, &read.scan.geometry);
    read.scans(&mut report);
    ground_truth::examine(&mut report, dataset);
    logs::examine(&mut report, dataset, logs, timing.as_ref());
    report
}

impl Report {
    fn line(&mut self, name: impl Into<String>, text: String) {
        self.lines.push((name.into(), text));
    }

    fn figure(&mut self, name: &str, value: impl Serialize) {
        self.figures.insert(name.to_owned(), json!(value));
    }

    fn find(&mut self, sentence: String) {
        self.findings.push(sentence);
    }

    fn name_of(&self, file: &Path) -> String {
        let name = file.strip_prefix(&self.root).unwrap_or(file);
        name.display().to_string()
    }
}

impl fmt::Display for Report {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(f, "{}", self.root.display())?;
        for (name, text) in &self.lines {
            writeln!(f, "  {name:<13} {text}")?;
        }
        writeln!(f, "findings")?;
        let mut findings = self.findings.iter();
        findings.try_for_each(|sentence| writeln!(f, "  - {sentence}"))
    }
}

struct ScansRead {
    scans_read: usize,
    rows: rows::Survey,
    unreadable: Vec<Value>,
    scan: OwnedScan,
}

impl ScansRead {
    fn of(dataset: &mut dyn Dataset) -> Self {
        let bytes = dataset.len() * dataset.limits().bytes;
        let step = bytes.div_ceil(PIXEL_BUDGET).max(1);
        let mut read = Self {
            scans_read: 0,
            rows: rows::Survey::default(),
            unreadable: Vec::new(),
            scan: OwnedScan::with_limits(dataset.limits()),
        };
        for index in dataset.scans().step_by(step) {
            read.scans_read += 1;
            match dataset.read(index, read.scan.slot()) {
                Ok(geometry) => {
                    read.scan.geometry = geometry;
                    read.rows.add(&read.scan.view());
                }
                Err(error) => {
                    let (file, error) = (dataset.file(index), error.to_string());
                    let of_scan = json!({"scan": index, "file": file, "error": error});
                    read.unreadable.push(of_scan);
                }
            }
        }
        read
    }

    fn images(&self, report: &mut Report, dataset: &dyn Dataset, options: &DatasetOptions) {
        let (scans, scans_read) = (report.scans, self.scans_read);
        report.line("format", report.format.to_string());
        let of_them = match scans_read < scans {
            true => format!(" ({scans_read} of them read)"),
            false => String::new(),
        };
        report.line("scans", format!("{scans}{of_them}"));
        report.figure("scans_read", scans_read);
        let (image, transposed) = (dataset.image_size(), dataset.is_transposed());
        let side = match transposed {
            true => ", transposed (range x azimuth)",
            false => "",
        };
        report.line("images", format!("{image}{side}"));
        report.figure("image", image);
        report.figure("transposed", transposed);
        let (geometry, azimuths) = (self.scan.geometry, self.rows.most_rows());
        let (bins, bin_m) = (geometry.bins, geometry.range_resolution_m);
        let sweep = format!("{azimuths} azimuths x {bins} range bins, clockwise");
        report.line("sweep", sweep);
        report.figure("azimuths", azimuths);
        report.figure("bins", bins);
        let offset_m = geometry.range_offset_m;
        let offset = match offset_m == 0.0 {
            true => String::new(),
            false => format!(", offset {offset_m} m"),
        };
        let max_range_m = self.scan.view().range_m(bins as f32 - 1.0);
        let range = format!("{bin_m:.6} m per bin{offset}, to {max_range_m:.1} m");
        report.line("range", range);
        for (name, value) in [
            ("range_resolution_m", bin_m),
            ("range_offset_m", offset_m),
            ("max_range_m", max_range_m),
        ] {
            // The number with the decimals that an f32 has.
            report.figure(name, value.to_string().parse::<f64>().ok());
        }
        let is_oxford = matches!(report.format, Format::Oxford | Format::Oord);
        if is_oxford && options.range_resolution_m.is_none() {
            report.find(format!(
                "The range resolution is {bin_m} m: with the 0.0432 m of the development kit, paths are more than 1 % short."
            ));
        }
    }

    fn scans(&self, report: &mut Report) {
        if report.scans == 1 {
            report.find("There is only one scan, but a motion requires two.".to_owned());
        }
        if let Some(first) = self.unreadable.first() {
            let indices = self.unreadable.iter().map(|it| it["scan"].to_string());
            let (places, first) = (some(indices), first["error"].as_str().unwrap_or_default());
            let (count, all) = (self.unreadable.len(), self.scans_read);
            report.find(format!(
                "{count} of {all} scans cannot be read (scans {places}): {first}."
            ));
        }
        report.figure("unreadable", &self.unreadable);
    }
}

fn velocity(report: &mut Report, scan: &PolarScan<'_>) {
    let min_range_m = PointsConfig::default().min_range_m;
    let (text, figures) = match DopplerEstimator::default().estimate(scan, min_range_m) {
        Err(NoDoppler::UnknownChirps | NoDoppler::NotAlternating { .. } | NoDoppler::Scan(_)) => {
            return report.figure("velocity", Value::Null);
        }
        Err(error) => {
            let (error, none) = (error.to_string(), Value::Null);
            let text = format!("unknown: {error}");
            let figures =
                json!({"velocity_mps": none, "sigma_mps": none, "bearings": 0, "error": error});
            (text, figures)
        }
        Ok(found) => {
            let ([ahead, left], [x, _, y]) = (found.value, found.covariance);
            let ([of_ahead, of_left], bearings) = ([x.sqrt(), y.sqrt()], found.samples);
            let text = format!(
                "{ahead:.2} +- {of_ahead:.2} m/s ahead, {left:.2} +- {of_left:.2} m/s to the left, by the Doppler shift of {bearings} bearings of the last scan read"
            );
            let figures = json!({
                "velocity_mps": found.value,
                "sigma_mps": [of_ahead, of_left],
                "bearings": bearings,
                "error": null,
            });
            (text, figures)
        }
    };
    report.line("velocity", text);
    report.figure("velocity", figures);
}

fn some(items: impl ExactSizeIterator<Item = String>) -> String {
    let more = items.len().saturating_sub(MAX_LISTED);
    let named = items.take(MAX_LISTED).collect::<Vec<_>>().join(", ");
    match more {
        0 => named,
        _ => format!("{named} and {more} more"),
    }
}
