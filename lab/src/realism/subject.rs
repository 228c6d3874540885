//! A recording that was named on the command line: its scans, how they moved, and what the searches
//! reach on it.

use std::{ops::Range, path::Path};

use gyre_evaluation::TimedMotion;
use gyre_geometry::{Pose, wrap_angle};
use gyre_radar::{DatasetOptions, OwnedScan, SweepGeometry};
use gyre_results::odometry;
use gyre_terminal::Failure;
use serde_json::json;

use super::{
    grid::{RangeGrid, resample},
    histogram::Histogram,
    sample::Sample,
    statistics::Statistics,
};
use crate::{
    cli::RealismArguments,
    recording::{Recording, Track},
    report::{Record, record},
    sequence::Sequence,
    tables::rows::Rows,
};

/// Consecutive scans that are measured in a row.
const RUN: usize = 8;
/// A motion that rotates by more than this is one in a turn.
const TURNING_DEG: f64 = 2.0;
/// A recording with fewer scans is not halved.
const MIN_HALVED: usize = 6;

/// The statistics of a recording, and of its halves: how far apart these are is what a distance
/// owes to chance and to the streets driven.
pub struct Measured {
    /// Of the whole recording, with the figures of the searches.
    pub whole: Statistics,
    /// Of the first and the second half; `None` where it has too few scans.
    pub halves: Option<[Statistics; 2]>,
}

/// A recording, open.
pub struct Subject {
    /// `sim`, `real` or `other`: the name of its folder of runs.
    pub role: &'static str,
    /// The recording with its configuration.
    pub sequence: Sequence,
    recording: Recording,
    /// The trajectory of the refined search.
    odometry: Option<Track>,
    /// The figures of the searches.
    searches: Record,
}

impl Subject {
    /// Opens the recordings of the command line.
    pub fn all(arguments: &RealismArguments) -> Result<Vec<Self>, Failure> {
        let RealismArguments { sim, real, .. } = arguments;
        let other = arguments.between.as_ref();
        let open = |role, data, file: &Option<_>| {
            Self::open(role, data, file.as_deref(), &arguments.configs)
        };
        let mut subjects = vec![
            open("sim", sim, &arguments.sim_config)?,
            open("real", real, &arguments.real_config)?,
        ];
        if let Some(other) = other {
            subjects.push(open("other", other, &arguments.between_config)?);
        }
        Ok(subjects)
    }

    /// Opens a recording by its configuration, or by the one in `configs` for its format.
    fn open(
        role: &'static str,
        data: &Path,
        file: Option<&Path>,
        configs: &Path,
    ) -> Result<Self, Failure> {
        let file = match file {
            Some(file) => file.to_owned(),
            None => {
                let dataset = gyre_radar::open(data, &DatasetOptions::default())?;
                configs.join(format!("{}.toml", dataset.format()))
            }
        };
        let sequence = Sequence::new(&file, data);
        let mut recording = sequence.open()?;
        recording.truth = recording.truth.filter(|truth| truth.lacks().is_none());
        Ok(Self {
            role,
            sequence,
            recording,
            odometry: None,
            searches: Record::new(),
        })
    }

    /// Returns the geometry of the first scan that can be read.
    pub fn geometry(&mut self) -> Result<SweepGeometry, Failure> {
        let first = self.recording.first_scans(1);
        let none = || format!("{}: no scan can be read", self.recording.data).into();
        first.first().map(|scan| scan.geometry).ok_or_else(none)
    }

    /// Runs the search in the paper's form, and the shipped configuration without refinement and
    /// with it, on the first `scans` scans, if there are two.
    pub fn search(&mut self, scans: usize, out: &Path) -> Result<(), Failure> {
        let scans = self.recording.played.len().min(scans);
        if scans < 2 {
            return Ok(());
        }
        let rows = Rows::read()?;
        let mut motions = Vec::new();
        for (search, row) in [
            ("plain", "f-raw, line 14"),
            ("alone", "Gyre, search alone"),
            ("refined", "Gyre"),
        ] {
            let named = rows.named(row);
            let mut changes = named.map_or_else(Vec::new, |row| row.changes(&rows));
            changes.push(format!("source.scans={scans}"));
            let out = out.join(self.role);
            let (folder, figures) = self.sequence.run(row, &changes, None, &out)?;
            self.odometry = Some(Track::read(&folder.join("trajectory.tum"))?);
            let named = |(key, value)| (format!("{search}/{key}"), value);
            self.searches.extend(figures.into_iter().map(named));
            motions.push(odometry::read(&folder.join("odometry.csv"))?);
        }
        if let [_, alone, refined] = motions.as_slice() {
            self.searches.extend(differences(alone, refined));
        }
        Ok(())
    }

    /// Measures at most `most` scans of the whole recording, and as many of each half.
    pub fn measure(&mut self, grid: RangeGrid, most: usize) -> Result<Measured, Failure> {
        let played = self.recording.played.clone();
        let middle = played.start + played.len() / 2;
        let mut part = |scans| self.measure_part(scans, grid, most);
        let mut whole = part(played.clone())?;
        let halves = match played.len() {
            ..MIN_HALVED => None,
            _ => Some([part(played.start..middle)?, part(middle..played.end)?]),
        };
        whole.figures.extend(self.searches.clone());
        Ok(Measured { whole, halves })
    }

    /// Measures at most `most` of these scans, each with its motion since the one before it where
    /// that is known.
    fn measure_part(
        &mut self,
        scans: Range<usize>,
        grid: RangeGrid,
        most: usize,
    ) -> Result<Statistics, Failure> {
        let (mut samples, mut raw) = (Vec::new(), Histogram::default());
        let mut scan = OwnedScan::with_limits(self.recording.dataset.limits());
        for run in runs(scans.len(), most) {
            let mut before_ns = None;
            for index in scans.start + run.start..scans.start + run.end {
                if !self.recording.read(index, &mut scan) {
                    before_ns = None;
                    continue;
                }
                let now_ns = scan.geometry.stamp_ns;
                let by = |known: &Option<Track>| motion(known.as_ref()?, before_ns?, now_ns);
                let motion = by(&self.recording.truth).or_else(|| by(&self.odometry));
                samples.push(Sample {
                    scan: resample(&scan.view(), grid)?,
                    motion,
                });
                raw.add(&scan.view());
                before_ns = Some(now_ns);
            }
        }
        if samples.is_empty() {
            return Err(format!("{} has no scan to measure", self.recording.data).into());
        }
        Ok(Statistics::of(&samples, &raw, grid)?)
    }
}

/// Returns the RMS differences of the motions by two methods on the same scans. They need no truth.
fn differences(a: &[TimedMotion], b: &[TimedMotion]) -> Record {
    let apart = |(a, b): (&TimedMotion, &TimedMotion)| {
        let (a, b) = (a.estimate.motion, b.estimate.motion);
        let turn_rad = wrap_angle(a.rotation.angle() - b.rotation.angle());
        let shift_m = (a.translation.vector - b.translation.vector).norm();
        (
            shift_m,
            turn_rad.to_degrees(),
            b.rotation.angle().to_degrees().abs() > TURNING_DEG,
        )
    };
    let apart: Vec<_> = a.iter().zip(b).map(apart).collect();
    let rms = |values: &mut dyn Iterator<Item = f64>| {
        let (count, sum) = values.fold((0, 0.0), |(count, sum), v| (count + 1, sum + v * v));
        (count > 0).then(|| (sum / f64::from(count)).sqrt())
    };
    let yaw = |turns: bool| {
        let some = apart.iter().filter(|(.., turning)| *turning == turns);
        rms(&mut some.map(|(_, yaw_deg, _)| *yaw_deg))
    };
    record(json!({
        "difference/translation_m": rms(&mut apart.iter().map(|(shift_m, ..)| *shift_m)),
        "difference/straight_deg": yaw(false),
        "difference/turning_deg": yaw(true),
    }))
}

fn motion(track: &Track, from_ns: i64, to_ns: i64) -> Option<Pose> {
    Some(track.pose(from_ns)?.inverse() * track.pose(to_ns)?)
}

/// At most `most` of `scans` scans, in runs of consecutive ones, evenly spread.
fn runs(scans: usize, most: usize) -> Vec<Range<usize>> {
    if scans <= most {
        return std::iter::once(0..scans).collect();
    }
    let length = RUN.min(most);
    let count = most / length;
    let start = |run: usize| run * (scans - length) / (count - 1).max(1);
    let range = |run| start(run)..start(run) + length;
    (0..count).map(range).collect()
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
