//! A recording that was named on the command line.

use std::{
    fs,
    ops::Range,
    path::{Path, PathBuf},
};

use crate::realism::{Measured, Meter, MeterConfig, Recording, ScanStatistics};
use gyre_radar::{Dataset, DatasetOptions, Format, OwnedScan, Trajectory};
use nalgebra::Isometry2;
use serde::Serialize;

use super::odometry::Searches;
use crate::report::save;
use crate::sequence::Sequence;
use gyre::{Failure, print};

/// Consecutive scans that are measured in a row.
const RUN: usize = 8;
/// A recording with fewer scans is not halved.
const LEAST_HALVED: usize = 6;
/// Stamps this close to a trajectory's end are its end, ns: files round.
const ROUNDING_NS: u64 = 1_000_000;

/// A recording, open.
pub struct Source {
    /// `sim`, `real` or `other`: what its files are called.
    pub role: &'static str,
    pub data: PathBuf,
    /// Its configuration, if one was named.
    pub configuration_file: Option<PathBuf>,
    /// What can be run on it.
    pub sequence: Sequence,
    /// The folder of all that is run on it.
    pub runs: PathBuf,
    /// The scans that its configuration plays.
    played: Range<usize>,
    dataset: Box<dyn Dataset>,
}

/// What of a recording is measured.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Part {
    Whole,
    FirstHalf,
    SecondHalf,
}

/// Pairs of consecutive scans that were aligned by each.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct Aligned {
    /// By ground truth.
    pub by_truth: usize,
    /// By the refined odometry.
    pub by_odometry: usize,
}

impl Source {
    /// Opens a recording by its configuration, or by the one that ships for its format.
    pub fn open(
        role: &'static str,
        data: &Path,
        configuration: Option<&Path>,
        out: &Path,
    ) -> Result<Self, Failure> {
        let runs = out.join(role);
        fs::create_dir_all(&runs)
            .map_err(|error| format!("cannot write to {}: {error}", runs.display()))?;
        let file = match configuration {
            Some(file) => file.to_owned(),
            None => {
                let format = gyre_radar::open(data, &DatasetOptions::default())?.format();
                let file = runs.join(format!("{format}.toml"));
                save(&file, shipped(format))?;
                file
            }
        };
        let sequence = Sequence::new(&file, data);
        let resolved = sequence.configuration(&[])?;
        let dataset = gyre_radar::open(data, &resolved.dataset)?;
        let played = resolved.played(dataset.len());
        let configuration_file = configuration.map(Path::to_owned);
        Ok(Self {
            role,
            data: data.to_owned(),
            configuration_file,
            sequence,
            runs,
            played,
            dataset,
        })
    }

    /// What it is called in tables.
    pub fn name(&self) -> String {
        let resolved = self
            .data
            .canonicalize()
            .unwrap_or_else(|_| self.data.clone());
        resolved
            .file_name()
            .unwrap_or_default()
            .to_string_lossy()
            .into_owned()
    }

    /// Scans that its configuration plays.
    pub fn scans(&self) -> usize {
        self.played.len()
    }

    /// The first scan that can be read.
    pub fn first_scan(&mut self) -> Result<OwnedScan, Failure> {
        self.scan_from(self.played.start)
    }

    /// The scan half-way through, or the next one that can be read.
    pub fn middle_scan(&mut self) -> Result<OwnedScan, Failure> {
        self.scan_from(self.played.start + self.scans() / 2)
    }

    fn scan_from(&mut self, first: usize) -> Result<OwnedScan, Failure> {
        let mut scan = OwnedScan::with_limits(self.dataset.limits());
        let found = (first..self.played.end).any(|index| self.read(index, &mut scan));
        match found {
            true => Ok(scan),
            false => Err(format!(
                "{}: no scan from number {first} on can be read",
                self.data.display()
            )
            .into()),
        }
    }

    /// Reads a scan; says why it cannot be read.
    fn read(&mut self, index: usize, scan: &mut OwnedScan) -> bool {
        let read = self.dataset.read(index, scan.slot());
        match read {
            Ok(geometry) => scan.geometry = geometry,
            Err(ref error) => print::note(format_args!("left out: {error}")),
        }
        read.is_ok()
    }

    /// Measures at most `most` scans of the whole recording, and as many of each half.
    pub fn measure(
        &mut self,
        config: MeterConfig,
        most: usize,
        searches: &Searches,
    ) -> Result<(Measured, Aligned), Failure> {
        let (whole, aligned) = self.measure_part(Part::Whole, config, most, searches)?;
        let halves = match self.scans() {
            ..LEAST_HALVED => None,
            _ => Some([
                self.measure_part(Part::FirstHalf, config, most, searches)?
                    .0,
                self.measure_part(Part::SecondHalf, config, most, searches)?
                    .0,
            ]),
        };
        Ok((Measured { whole, halves }, aligned))
    }

    fn measure_part(
        &mut self,
        part: Part,
        config: MeterConfig,
        most: usize,
        searches: &Searches,
    ) -> Result<(Recording, Aligned), Failure> {
        let scans = part.of(self.played.clone());
        let (statistics, aligned) = self.statistics(scans, config, most, searches)?;
        let (plain, refined) = (
            searches.errors(&searches.plain, part),
            searches.errors(&searches.refined, part),
        );
        Ok((
            Recording {
                name: self.name(),
                statistics,
                plain,
                refined,
            },
            aligned,
        ))
    }

    /// ScanStatistics of at most `most` of these scans, each with its motion since the one before it where that is known.
    fn statistics(
        &mut self,
        scans: Range<usize>,
        config: MeterConfig,
        most: usize,
        searches: &Searches,
    ) -> Result<(ScanStatistics, Aligned), Failure> {
        let mut meter = Meter::new(config)?;
        let mut aligned = Aligned::default();
        let mut scan = OwnedScan::with_limits(self.dataset.limits());
        for run in runs(scans.len(), most) {
            let mut before_ns = None;
            for index in scans.start + run.start..scans.start + run.end {
                if !self.read(index, &mut scan) {
                    before_ns = None;
                    continue;
                }
                let now_ns = scan.geometry.stamp_ns;
                let motion = before_ns
                    .and_then(|before_ns| searches.motion(before_ns, now_ns, &mut aligned));
                meter.add(&scan.view(), motion.as_ref())?;
                before_ns = Some(now_ns);
            }
        }
        let statistics = meter
            .finish()
            .ok_or_else(|| format!("{} has no scan to measure", self.data.display()))?;
        Ok((statistics, aligned))
    }
}

impl Part {
    /// The scans of it.
    fn of(self, scans: Range<usize>) -> Range<usize> {
        let middle = scans.start + scans.len() / 2;
        match self {
            Self::Whole => scans,
            Self::FirstHalf => scans.start..middle,
            Self::SecondHalf => middle..scans.end,
        }
    }

    /// The poses of it.
    pub fn of_trajectory(self, trajectory: &Trajectory) -> Trajectory {
        let poses = self.of(0..trajectory.len());
        let stamps = trajectory.stamp_ns.as_ref();
        Trajectory {
            stamp_ns: stamps.map(|stamps| stamps[poses.clone()].to_vec()),
            poses: trajectory.poses[poses].to_vec(),
        }
    }
}

impl Searches {
    /// The motion from one time to another, by the truth if it can, else by the refined odometry.
    fn motion(&self, from_ns: i64, to_ns: i64, aligned: &mut Aligned) -> Option<Isometry2<f64>> {
        let by = |trajectory: &Option<Trajectory>| motion(trajectory.as_ref()?, from_ns, to_ns);
        if let Some(motion) = by(&self.truth) {
            aligned.by_truth += 1;
            return Some(motion);
        }
        let motion = by(&self.refined)?;
        aligned.by_odometry += 1;
        Some(motion)
    }
}

fn motion(trajectory: &Trajectory, from_ns: i64, to_ns: i64) -> Option<Isometry2<f64>> {
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
            runs(scans, most)
                .iter()
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
