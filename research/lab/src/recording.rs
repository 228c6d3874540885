//! A recording as a configuration plays it, and the truth about its path.

use std::{ops::Range, path::{Path, PathBuf}};

use gyre_configuration::{Configuration, Played, terminal::{Failure, print}};
use gyre_datasets::{Dataset, ground_truth::{find_ground_truth, parse_trajectory, read_trajectory}};
use gyre_geometry::{Pose, OwnedScan};
use gyre_radar::Trajectory;
use gyre_results::SIMULATED_TRUTH;

/// A trajectory is not interpolated across wider gaps, as in `gyre evaluate`, but for those that
/// all its steps are.
const MAX_GAP_NS: i64 = 1_000_000_000;

/// A recording or a simulation, open.
pub struct Recording {
    /// The folder as it was named, or `a simulation`.
    pub data: String,
    /// The scans.
    pub dataset: Box<dyn Dataset>,
    /// The scans that the configuration plays.
    pub played: Range<usize>,
    /// `None` where none was named and none lies in the folder.
    pub truth: Option<Track>,
}

/// A path of the sensor.
pub struct Track {
    /// The file; of a simulation, the one that it would leave in the results of a run.
    pub path: PathBuf,
    trajectory: Trajectory,
    max_gap_ns: u64,
}

impl Recording {
    /// Opens what a configuration names, as a run of it would.
    pub fn open(configuration: &Configuration) -> Result<Self, Failure> {
        let Played { dataset, truth, .. } = gyre_configuration::open(configuration)?;
        let named = configuration.run.ground_truth.clone();
        let truth = match truth {
            Some(tum) if named.is_none() => Some(Track::simulated(&tum)?),
            _ => {
                let path = named.or_else(|| find_ground_truth(&configuration.source.data));
                path.map(|path| Track::read(&path)).transpose()?
            }
        };
        Ok(Self {
            data: configuration.data(),
            played: configuration.source.played(dataset.scans()),
            dataset,
            truth,
        })
    }

    /// Reads a scan; says so and returns false where it cannot be read.
    pub fn read(&mut self, index: usize, scan: &mut OwnedScan) -> bool {
        let read = self.dataset.read(index, scan.slot());
        match &read {
            Ok(geometry) => scan.geometry = *geometry,
            Err(error) => print::note(format_args!("left out: {error}")),
        }
        read.is_ok()
    }

    /// Reads the first `most` scans that can be read.
    pub fn first_scans(&mut self, most: usize) -> Vec<OwnedScan> {
        let played = self.played.clone();
        let read = |index| {
            let mut scan = OwnedScan::with_limits(self.dataset.limits());
            self.read(index, &mut scan).then_some(scan)
        };
        played.filter_map(read).take(most).collect()
    }
}

impl Track {
    /// Reads a trajectory.
    pub fn read(path: &Path) -> Result<Self, Failure> {
        Ok(Self::new(path.to_owned(), read_trajectory(path)?))
    }

    /// The truth about a simulation: what `gyre simulate` writes, so that it does not matter
    /// whether that was done.
    fn simulated(tum: &[u8]) -> Result<Self, Failure> {
        let path = PathBuf::from(SIMULATED_TRUTH);
        let trajectory = parse_trajectory(&String::from_utf8_lossy(tum), &path)?;
        Ok(Self::new(path, trajectory))
    }

    fn new(path: PathBuf, trajectory: Trajectory) -> Self {
        let stamps = trajectory.stamps();
        let max_gap_ns = gyre_results::evaluation::max_gap_ns(stamps, MAX_GAP_NS).unsigned_abs();
        Self {
            path,
            trajectory,
            max_gap_ns,
        }
    }

    /// Returns what it lacks to give poses at given times: `times` or `headings`.
    pub fn lacks(&self) -> Option<&'static str> {
        match (self.trajectory.span_ns(), self.trajectory.has_heading()) {
            (None, _) => Some("times"),
            (_, false) => Some("headings"),
            _ => None,
        }
    }

    /// Returns the pose at a time, in the trajectory's own frame; `None` before the first, after
    /// the last, and in gaps.
    pub fn pose(&self, stamp_ns: i64) -> Option<Pose> {
        let gap_ns = gap_ns(&self.trajectory, stamp_ns);
        let pose = self.trajectory.near(stamp_ns, Trajectory::ROUNDING_NS);
        pose.filter(|_| gap_ns.is_none_or(|gap_ns| gap_ns <= self.max_gap_ns))
    }
}

/// Time between the poses around a time, ns: 0 at a pose, `None` outside the time span.
fn gap_ns(trajectory: &Trajectory, stamp_ns: i64) -> Option<u64> {
    let stamps = trajectory.stamp_ns.as_ref()?;
    let after = stamps.partition_point(|s| *s < stamp_ns);
    let to = *stamps.get(after)?;
    if to == stamp_ns {
        return Some(0);
    }
    Some(to.abs_diff(stamps[after.checked_sub(1)?]))
}

/// Returns the last name of a path; `recordings/.` and the like have one only once they are
/// resolved.
pub fn folder_name(path: &Path) -> String {
    let resolved = path.canonicalize().unwrap_or_else(|_| path.to_owned());
    let name = resolved.file_name().unwrap_or_default();
    name.to_string_lossy().into_owned()
}

#[cfg(test)]
mod tests {
    use gyre_geometry::pose;

    use super::*;

    #[test]
    fn poses_are_known_up_to_rounding_and_not_in_gaps() {
        let stamp_ns = Some(vec![1, 1_000_000_001, 2_500_000_002, 3_500_000_002]);
        let poses = [0.0, 1.0, 2.0, 3.0].map(|x| pose(x, 0.0, 0.0)).to_vec();
        let truth = Track::new(PathBuf::new(), Trajectory { stamp_ns, poses });
        let x = |stamp_ns| truth.pose(stamp_ns).map(|pose| pose.translation.x);
        assert_eq!([x(-999_999), x(500_000_001)], [Some(0.0), Some(0.5)]);
        assert_eq!(
            [x(1_000_000_001), x(2_500_000_002), x(3_501_000_002)],
            [Some(1.0), Some(2.0), Some(3.0)]
        );
        assert_eq!(
            [
                x(-1_000_000),
                x(1_000_000_002),
                x(2_000_000_001),
                x(3_501_000_003)
            ],
            [None; 4]
        );
    }
}
