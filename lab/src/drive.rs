//! The keyframes of a run, with their points and true poses.

use std::{convert::Infallible, path::Path};

use gyre_configuration::Configuration;
use gyre_datasets::{find_ground_truth, read_trajectory};
use gyre_estimation::places::{MAX_NEIGHBOURS, PlaceOptions, neighbours};
use gyre_evaluation::TimedMotion;
use gyre_geometry::{ComposedMotion, Pose, UncertainMotion};
use gyre_masking::MaskKind;
use gyre_odometry::Odometry;
use gyre_radar::{OwnedScan, Trajectory};
use gyre_results::odometry;
use gyre_scan_matching::{RefinementConfig, Submap};
use gyre_slam::{Keyframe, KeyframeBuilder, KeyframeSource, ScanPose};
use gyre_terminal::Failure;

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
    submap_reach_m: f64,
}

impl Drive {
    /// Selects the keyframes of the run in the folder `run`, and extracts their points from its
    /// recording. A learned mask is not applied.
    ///
    /// # Errors
    /// Results or a recording that cannot be read, or have no ground truth.
    pub fn read(run: &Path, options: &PlaceOptions) -> Result<Self, Failure> {
        let mut configuration = Configuration::read(&run.join("config.toml"), &[])?;
        if configuration.odometry.masking.kind == MaskKind::Learned {
            configuration.odometry.masking.kind = MaskKind::Threshold;
        }
        let data = configuration.source.data.clone();
        let truth = configuration.run.ground_truth.clone();
        let truth = truth
            .or_else(|| find_ground_truth(&data))
            .ok_or_else(|| format!("{} has no ground truth", data.display()))?;
        let motions = odometry::read(&run.join("odometry.csv"))?;
        let capacity = configuration.odometry.points.capacity;
        let mut drive = Self {
            estimate: read_trajectory(&run.join("trajectory.tum"))?,
            truth: read_trajectory(&truth)?,
            keyframes: Vec::new(),
            truths: Vec::new(),
            path_m: Vec::new(),
            refinement: configuration.odometry.refinement.clone(),
            capacity,
            submaps: [0, 1].map(|_| Submap::with_capacity(capacity * (2 * MAX_NEIGHBOURS + 1))),
            submap_reach_m: options.submap_reach_m,
        };
        drive.select(&configuration, &data, &motions, options)?;
        Ok(drive)
    }

    /// Returns the distance of two keyframes by the truth, m; infinite where it is unknown.
    pub fn true_distance_m(&self, a: usize, b: usize) -> f64 {
        match (self.truths[a], self.truths[b]) {
            (Some(a), Some(b)) => (a.translation.vector - b.translation.vector).norm(),
            _ => f64::INFINITY,
        }
    }

    fn select(
        &mut self,
        configuration: &Configuration,
        data: &Path,
        motions: &[TimedMotion],
        options: &PlaceOptions,
    ) -> Result<(), Failure> {
        let mut dataset = gyre_datasets::open(data, &configuration.dataset)?;
        let mut scan = OwnedScan::with_limits(dataset.limits());
        // Where azimuths were lost, points are right only if they are put back, for which the
        // scans before are needed.
        let mut odometry = Odometry::new(&configuration.odometry)?;
        let mut builder = KeyframeBuilder::new(options);
        let stamps = self.estimate.stamp_ns.clone().unwrap_or_default();
        if motions.len() + 1 != stamps.len() {
            return Err("odometry.csv and trajectory.tum are not of one run".into());
        }
        let mut reckoned = ComposedMotion::new();
        for (k, pose) in self.estimate.poses.iter().enumerate() {
            scan.geometry = dataset.read(k, scan.slot())?;
            odometry.register(&scan.view(), &[])?;
            let last = k.checked_sub(1);
            let motion = last.map_or_else(Default::default, |last| motions[last].estimate);
            reckoned = reckoned.then(&motion);
            let placed = ScanPose {
                seq: k as u64,
                scan: k as u64,
                stamp_ns: stamps[k],
                pose: UncertainMotion {
                    motion: *pose,
                    covariance: reckoned.motion().covariance,
                },
                motion,
                interval_s: last.map_or(0.0, |last| (stamps[k] - stamps[last]) as f64 * 1e-9),
            };
            let Some(keyframe) = builder.next(&placed) else {
                continue;
            };
            if scan.geometry.stamp_ns.abs_diff(stamps[k]) > SAME_TIME_NS {
                return Err(format!(
                    "pose {k} is not that of scan {k}: the run must have used all scans"
                )
                .into());
            }
            self.truths.push(self.truth.near(stamps[k], SAME_TIME_NS));
            self.path_m.push(keyframe.path_m);
            self.keyframes.push(Keyframe {
                points: odometry.points().to_vec(),
                ..keyframe
            });
        }
        Ok(())
    }

    /// Makes the submap around a keyframe the query's (0) or the candidate's (1).
    pub fn draw(&mut self, keyframe: usize, submap: usize) {
        let middle = &self.keyframes[keyframe];
        let submap = &mut self.submaps[submap];
        submap.start(&middle.points, &middle.twist);
        for k in neighbours(&self.path_m, keyframe, self.submap_reach_m).filter(|k| *k != keyframe)
        {
            let other = &self.keyframes[k];
            submap.add(
                &other.points,
                &other.twist,
                &middle.pose.motion.inv_mul(&other.pose.motion),
            );
        }
    }
}

impl KeyframeSource for &Drive {
    type Error = Infallible;

    fn keyframe(&mut self, index: usize) -> Result<Keyframe, Infallible> {
        Ok(self.keyframes[index].clone())
    }
}
