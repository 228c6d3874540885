//! A recording that was named on the command line: its scans, how they moved, and what the searches reach on it.

use std::{
    ops::Range,
    path::{Path, PathBuf},
};

use gyre::{Failure, print};
use gyre_geometry::Pose;
use gyre_radar::{
    Dataset, DatasetOptions, Format, OwnedScan, Trajectory,
    ground_truth::{find_ground_truth, read_trajectory},
};
use serde::Serialize;

use super::statistics::{Meter, MeterConfig, ScanStatistics};
use crate::{
    report::{make_folder, save},
    sequence::{Figures, Sequence},
    tables::rows::Rows,
};

/// Consecutive scans that are measured in a row.
const RUN: usize = 8;
/// A recording with fewer scans is not halved.
const MIN_HALVED: usize = 6;
/// Stamps this close to a trajectory's end are its end, ns: files round.
const ROUNDING_NS: u64 = 1_000_000;

/// A recording as a whole, and its halves: how far apart these are is what a distance owes to chance and to the streets driven.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Measured {
    /// The whole recording.
    pub whole: Recording,
    /// The first and the second half; `None` where it has too few scans.
    #[serde(skip)]
    pub halves: Option<[Recording; 2]>,
}

/// The measurements of a recording, or of a half.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Recording {
    /// The folder's name.
    pub name: String,
    /// Statistics of the scans.
    pub statistics: ScanStatistics,
    /// The plain search, in the paper's form: nothing without ground truth or without a second scan, nor for a half.
    pub plain: Figures,
    /// The refined search: the shipped configuration.
    pub refined: Figures,
    /// Pairs of consecutive scans that were aligned by ground truth.
    pub aligned_by_truth: usize,
    /// Pairs of consecutive scans that were aligned by the refined search.
    pub aligned_by_odometry: usize,
}

/// A recording, open.
pub struct Source {
    /// `sim`, `real` or `other`: what its files are called.
    pub role: &'static str,
    /// The folder.
    pub data: PathBuf,
    sequence: Sequence,
    /// The scans that its configuration plays.
    played: Range<usize>,
    dataset: Box<dyn Dataset>,
    /// Ground truth with times and headings.
    truth: Option<Trajectory>,
    /// The trajectory of the refined search.
    odometry: Option<Trajectory>,
    plain: Figures,
    refined: Figures,
}

impl Source {
    /// Opens a recording by its configuration, or by the one that ships for its format.
    ///
    /// # Errors
    /// A recording or a configuration that cannot be read.
    pub fn open(
        role: &'static str,
        data: &Path,
        configuration: Option<&Path>,
        out: &Path,
    ) -> Result<Self, Failure> {
        let file = match configuration {
            Some(file) => file.to_owned(),
            None => {
                let format = gyre_radar::open(data, &DatasetOptions::default())?.format();
                make_folder(&out.join(role))?;
                let file = out.join(role).join(format!("{format}.toml"));
                save(&file, shipped(format))?;
                file
            }
        };
        let sequence = Sequence::new(&file, data);
        let configuration = sequence.configuration(&[])?;
        let dataset = gyre_radar::open(data, &configuration.dataset)?;
        let truth = find_ground_truth(data)
            .map(|path| read_trajectory(&path))
            .transpose()?;
        Ok(Self {
            role,
            data: data.to_owned(),
            sequence,
            played: configuration.source.played(dataset.len()),
            dataset,
            truth: truth.filter(|truth| truth.stamp_ns.is_some() && truth.has_heading()),
            odometry: None,
            plain: Figures::new(),
            refined: Figures::new(),
        })
    }

    /// Runs the search in the paper's form and the shipped configuration on the first `scans` scans, if there are two.
    ///
    /// # Errors
    /// A run that does not succeed.
    pub fn search(&mut self, scans: usize, out: &Path) -> Result<(), Failure> {
        let scans = self.played.len().min(scans);
        if scans < 2 {
            return Ok(());
        }
        let rows = Rows::read()?;
        let run = |row: &str| {
            let mut changes = rows
                .named(row)
                .map_or_else(Vec::new, |row| row.changes(&rows, None));
            changes.push(format!("source.scans={scans}"));
            self.sequence.run(row, &changes, &out.join(self.role))
        };
        let (plain, (folder, refined)) = (run("f-raw, line 14")?.1, run("Gyre")?);
        self.odometry = Some(read_trajectory(&folder.join("trajectory.tum"))?);
        (self.plain, self.refined) = (plain.figures, refined.figures);
        Ok(())
    }

    /// Reads the first scan that can be read.
    ///
    /// # Errors
    /// No scan can be read.
    pub fn first_scan(&mut self) -> Result<OwnedScan, Failure> {
        let mut scan = OwnedScan::with_limits(self.dataset.limits());
        match self.played.clone().any(|index| self.read(index, &mut scan)) {
            true => Ok(scan),
            false => Err(format!("{}: no scan can be read", self.data.display()).into()),
        }
    }

    /// Reads a scan; prints why it cannot be read.
    fn read(&mut self, index: usize, scan: &mut OwnedScan) -> bool {
        let read = self.dataset.read(index, scan.slot());
        match read {
            Ok(geometry) => scan.geometry = geometry,
            Err(ref error) => print::note(format_args!("left out: {error}")),
        }
        read.is_ok()
    }

    /// Measures at most `most` scans of the whole recording, and as many of each half.
    ///
    /// # Errors
    /// No scan can be measured.
    pub fn measure(&mut self, config: MeterConfig, most: usize) -> Result<Measured, Failure> {
        let Range { start, end } = self.played;
        let middle = start + self.played.len() / 2;
        let mut part = |scans| self.measure_part(scans, config, most);
        let whole = part(start..end)?;
        let halves = match end - start {
            ..MIN_HALVED => None,
            _ => Some([part(start..middle)?, part(middle..end)?]),
        };
        let (plain, refined) = (self.plain.clone(), self.refined.clone());
        let whole = Recording {
            plain,
            refined,
            ..whole
        };
        Ok(Measured { whole, halves })
    }

    /// Measures at most `most` of these scans, each with its motion since the one before it where that is known.
    fn measure_part(
        &mut self,
        scans: Range<usize>,
        config: MeterConfig,
        most: usize,
    ) -> Result<Recording, Failure> {
        let mut meter = Meter::new(config)?;
        let (mut by_truth, mut by_odometry) = (0, 0);
        let mut scan = OwnedScan::with_limits(self.dataset.limits());
        for run in runs(scans.len(), most) {
            let mut before_ns = None;
            for index in scans.start + run.start..scans.start + run.end {
                if !self.read(index, &mut scan) {
                    before_ns = None;
                    continue;
                }
                let now_ns = scan.geometry.stamp_ns;
                let by = |known: &Option<Trajectory>| motion(known.as_ref()?, before_ns?, now_ns);
                let (truth, odometry) = (by(&self.truth), by(&self.odometry));
                by_truth += usize::from(truth.is_some());
                by_odometry += usize::from(truth.is_none() && odometry.is_some());
                meter.add(&scan.view(), truth.or(odometry).as_ref())?;
                before_ns = Some(now_ns);
            }
        }
        let nothing = || format!("{} has no scan to measure", self.data.display());
        let resolved = self
            .data
            .canonicalize()
            .unwrap_or_else(|_| self.data.clone());
        Ok(Recording {
            name: resolved
                .file_name()
                .unwrap_or_default()
                .to_string_lossy()
                .into_owned(),
            statistics: meter.finish().ok_or_else(nothing)?,
            plain: Figures::new(),
            refined: Figures::new(),
            aligned_by_truth: by_truth,
            aligned_by_odometry: by_odometry,
        })
    }
}

fn motion(trajectory: &Trajectory, from_ns: i64, to_ns: i64) -> Option<Pose> {
    let at = |stamp_ns| trajectory.near(stamp_ns, ROUNDING_NS);
    Some(at(from_ns)?.inverse() * at(to_ns)?)
}

/// At most `most` of `scans` scans, in runs of consecutive ones, evenly spread.
fn runs(scans: usize, most: usize) -> Vec<Range<usize>> {
    if scans <= most {
        return std::iter::once(0..scans).collect();
    }
    let length = RUN.min(most);
    let count = most / length;
    let start = |run: usize| run * (scans - length) / (count - 1).max(1);
    (0..count)
        .map(|run| start(run)..start(run) + length)
        .collect()
}

/// The configuration that ships for a format.
fn shipped(format: Format) -> &'static str {
    match format {
        Format::Oxford => include_str!("../../../configs/oxford.toml"),
        Format::Boreas => include_str!("../../../configs/boreas.toml"),
        Format::BoreasRt => include_str!("../../../configs/boreas-rt.toml"),
        Format::Mulran => include_str!("../../../configs/mulran.toml"),
        Format::Radiate => include_str!("../../../configs/radiate.toml"),
        Format::Fomo => include_str!("../../../configs/fomo.toml"),
        Format::Oord | Format::MulranOxfordForm => "",
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn runs_cover_a_short_recording_and_spread_over_a_long_one() {
        let ends = |scans, most| {
            let runs = runs(scans, most);
            runs.iter()
                .map(|run| (run.start, run.end))
                .collect::<Vec<_>>()
        };
        assert_eq!(ends(11, 64), [(0, 11)]);
        assert_eq!(ends(100, 16), [(0, 8), (92, 100)]);
        assert_eq!(ends(100, 8), [(0, 8)]);
        assert_eq!(ends(100, 3), [(0, 3)]);
        let spread = runs(466, 64);
        assert_eq!(
            (spread.len(), spread[0].clone(), spread[7].clone()),
            (8, 0..8, 458..466)
        );
        assert!(spread.windows(2).all(|pair| pair[0].end <= pair[1].start));
        assert!(runs(65, 64).iter().all(|run| run.end <= 65));
    }
}
