//! The keyframes of a run, with their points and true poses.

use std::path::Path;

use gyre_configuration::{Configuration, terminal::Failure};
use gyre_datasets::{find_ground_truth, read_trajectory};
use gyre_geometry::Pose;
use gyre_matching::{RefinementConfig, Submap};
use gyre_radar::Trajectory;
use gyre_slam::{estimation::places::{MAX_NEIGHBOURS, SUBMAP_REACH_M, neighbours}, Keyframe, RecordReader};

/// Poses of a run and of the truth belong to a scan if they are this near in time.
const SAME_TIME_NS: u64 = 50_000_000;

/// A run with its keyframes and the truth about them.
pub struct Drive {
    /// The poses of all scans by the run, and the true trajectory.
    pub estimate: Trajectory,
    pub truth: Trajectory,
    pub keyframes: Vec<Keyframe>,
    /// The true pose of each keyframe.
    pub truths: Vec<Option<Pose>>,
    /// The path up to each keyframe, m.
    pub path_m: Vec<f64>,
    pub refinement: RefinementConfig,
    /// Largest number of points of a keyframe.
    pub capacity: usize,
    /// The submap of a query and that of a candidate.
    pub submaps: [Submap; 2],
}

impl Drive {
    /// Reads the keyframes of the run in the folder `run`, one with `slam.kind=graph` or `filter`.
    ///
    /// # Errors
    /// Results that cannot be read or have no keyframes, or a recording without ground truth.
    pub fn read(run: &Path) -> Result<Self, Failure> {
        let configuration = Configuration::read(&run.join("config.toml"), &[])?;
        let data = &configuration.source.data;
        let truth = configuration.run.ground_truth.clone();
        let truth = truth
            .or_else(|| find_ground_truth(data))
            .ok_or_else(|| format!("{} has no ground truth", data.display()))?;
        let truth = read_trajectory(&truth)?;
        let mut keyframes = RecordReader::<Keyframe>::open(run)?;
        if keyframes.is_empty() {
            return Err("the run has no keyframes: add --set slam.kind=graph".into());
        }
        let keyframes: Vec<Keyframe> = (0..keyframes.len())
            .map(|index| keyframes.read(index))
            .collect::<Result<_, _>>()?;
        let capacity = configuration.odometry.points.capacity;
        Ok(Self {
            estimate: read_trajectory(&run.join("trajectory.tum"))?,
            truths: keyframes
                .iter()
                .map(|it| truth.near(it.stamp_ns, SAME_TIME_NS))
                .collect(),
            path_m: keyframes.iter().map(|it| it.path_m).collect(),
            keyframes,
            truth,
            refinement: configuration.odometry.refinement,
            capacity,
            submaps: [0, 1].map(|_| Submap::with_capacity(capacity * (2 * MAX_NEIGHBOURS + 1))),
        })
    }

    /// Returns the distance of two keyframes by the truth, m; infinite where it is unknown.
    pub fn true_distance_m(&self, a: usize, b: usize) -> f64 {
        match (self.truths[a], self.truths[b]) {
            (Some(a), Some(b)) => (a.translation.vector - b.translation.vector).norm(),
            _ => f64::INFINITY,
        }
    }

    /// Makes the submap around a keyframe the query's (0) or the candidate's (1).
    pub fn draw(&mut self, keyframe: usize, submap: usize) {
        let middle = &self.keyframes[keyframe];
        let submap = &mut self.submaps[submap];
        submap.start(&middle.points, &middle.twist);
        for k in neighbours(&self.path_m, keyframe, SUBMAP_REACH_M).filter(|k| *k != keyframe) {
            let other = &self.keyframes[k];
            submap.add(
                &other.points,
                &other.twist,
                &middle.pose.motion.inv_mul(&other.pose.motion),
            );
        }
    }
}
