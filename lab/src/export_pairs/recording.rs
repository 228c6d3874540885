//! A recording that is exported, with its truth.

use std::{
    ops::Range,
    path::{Path, PathBuf},
};

use gyre::{Failure, configuration::Configuration, preflight, results};
use gyre_geometry::Pose;
use gyre_radar::{
    Dataset, Format, Trajectory, find_ground_truth,
    ground_truth::{parse_trajectory, read_trajectory},
};

use crate::cli::ExportPairsArguments;

/// Times that miss the truth by no more than this are its ends: files round.
const ROUNDING_NS: u64 = 1_000_000;
/// The truth is not interpolated across wider gaps, as in `gyre evaluate`.
const MAX_GAP_NS: u64 = 1_000_000_000;

/// A recording, open.
pub struct Recording {
    pub dataset: Box<dyn Dataset>,
    /// The scans that the configuration plays.
    pub played: Range<usize>,
    pub source: Source,
}

/// The origin of the scans.
pub struct Source {
    /// The folder as it was named, or `a simulation`.
    pub data: String,
    pub format: Format,
    pub truth: Truth,
}

/// The path of the sensor.
pub struct Truth {
    /// The file; of a simulation, the one that it would leave in the results of a run.
    pub path: PathBuf,
    trajectory: Trajectory,
}

/// Returns the configuration of each recording that was named on the command line, or of what the configuration itself plays.
///
/// # Errors
/// A configuration that cannot be read, one truth for several recordings.
pub fn configurations(arguments: &ExportPairsArguments) -> Result<Vec<Configuration>, Failure> {
    let mut common = Configuration::read(&arguments.configuration, &arguments.set)?;
    common.run.ground_truth = arguments.ground_truth.clone().or(common.run.ground_truth);
    let truth = common
        .run
        .ground_truth
        .as_ref()
        .map(|truth| truth.display());
    match (truth, arguments.data.len()) {
        (Some(truth), recordings @ 2..) => Err(format!(
            "{truth} can be the truth of one recording, not of {recordings}: without it, each has its own"
        )
        .into()),
        (_, 0) => Ok(vec![common.streaming(None)]),
        _ => {
            let with = |data: &PathBuf| common.clone().streaming(Some(data));
            Ok(arguments.data.iter().map(with).collect())
        }
    }
}

impl Recording {
    /// Opens what a configuration names, as a run of it would.
    ///
    /// # Errors
    /// A recording that cannot be read, or has no truth to train with.
    pub fn open(configuration: &Configuration) -> Result<Self, Failure> {
        let preflight::Played { dataset, truth } = preflight::open(configuration)?;
        let source = Source {
            data: configuration.data(),
            format: dataset.format(),
            truth: match (truth, &configuration.run.ground_truth) {
                (Some(tum), None) => Truth::simulated(&tum),
                _ => Truth::read(configuration),
            }?,
        };
        let played = configuration.source.played(dataset.len());
        Ok(Self {
            dataset,
            played,
            source,
        })
    }
}

impl Source {
    /// The name of its folder.
    pub fn name(&self) -> String {
        let folder = Path::new(&self.data).canonicalize().ok();
        let name = folder.as_deref().and_then(Path::file_name);
        name.map_or_else(
            || self.data.clone(),
            |name| name.to_string_lossy().into_owned(),
        )
    }
}

impl Truth {
    /// The truth about a simulation: what `gyre simulate` writes, so that it does not matter whether that was done.
    fn simulated(tum: &[u8]) -> Result<Self, Failure> {
        let path = PathBuf::from(results::SIMULATED_TRUTH);
        let trajectory = parse_trajectory(&String::from_utf8_lossy(tum), &path)?;
        Ok(Self { path, trajectory })
    }

    /// The truth that was named, or what lies beside the recording.
    fn read(configuration: &Configuration) -> Result<Self, Failure> {
        let (named, data) = (&configuration.run.ground_truth, &configuration.source.data);
        let path = named.clone().or_else(|| find_ground_truth(data)).ok_or_else(|| {
            let data = data.display();
            format!("{data} has no ground truth, and masks are trained by true poses: name it with --ground-truth")
        })?;
        let trajectory = read_trajectory(&path)?;
        let lacks = match (trajectory.span_ns(), trajectory.has_heading()) {
            (None, _) => "times",
            (_, false) => "headings",
            _ => return Ok(Self { path, trajectory }),
        };
        let path = path.display();
        Err(
            format!("{path} has no {lacks}, and masks are trained by poses at the scans' times")
                .into(),
        )
    }

    /// Returns the pose at a time, in the truth's own frame; `None` before the first, after the last, and in gaps.
    pub fn pose(&self, stamp_ns: i64) -> Option<Pose> {
        let gap_ns = self.trajectory.gap_ns(stamp_ns);
        let pose = self.trajectory.near(stamp_ns, ROUNDING_NS);
        pose.filter(|_| gap_ns.is_none_or(|gap_ns| gap_ns <= MAX_GAP_NS))
    }
}

#[cfg(test)]
mod tests {
    use gyre_geometry::pose;

    use super::*;

    #[test]
    fn poses_are_known_up_to_rounding_and_not_in_gaps() {
        let stamp_ns = Some(vec![1_000_000_000, 2_000_000_000, 3_000_000_001]);
        let poses = [1.0, 2.0, 3.0].map(|x| pose(x, 0.0, 0.0)).to_vec();
        let truth = Truth {
            path: PathBuf::new(),
            trajectory: Trajectory { stamp_ns, poses },
        };
        let x = |stamp_ns| truth.pose(stamp_ns).map(|pose| pose.translation.x);
        assert_eq!([x(999_000_000), x(1_500_000_000)], [Some(1.0), Some(1.5)]);
        assert_eq!(
            [x(2_000_000_000), x(3_000_000_001), x(3_001_000_001)],
            [Some(2.0), Some(3.0), Some(3.0)]
        );
        assert_eq!(
            [
                x(998_999_999),
                x(2_000_000_001),
                x(2_500_000_000),
                x(3_001_000_002)
            ],
            [None; 4]
        );
    }
}
