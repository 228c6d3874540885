//! The keyframes of a run, with their points and true poses.

use std::path::Path;

use gyre::{Failure, configuration::Configuration};
use gyre_estimation::places::{KeyframeSelector, MAX_NEIGHBOURS, PlaceOptions, neighbours};
use gyre_geometry::{Pose, SparsePoint, Twist};
use gyre_masking::{MaskKind, Masker};
use gyre_radar::{OwnedScan, Trajectory, find_ground_truth, read_trajectory};
use gyre_scan_matching::{RefinementConfig, Submap};

/// Poses of a run and of the truth belong to a scan if they are this near in time.
const SAME_TIME_NS: u64 = 50_000_000;

/// A keyframe of a run.
pub struct Keyframe {
    /// The scan's number in the recording.
    pub scan: usize,
    pub points: Vec<SparsePoint>,
    /// Pose and velocity by the run.
    pose: Pose,
    twist: Twist,
    /// The true pose.
    pub truth: Option<Pose>,
}

/// The keyframes of a run.
pub struct Drive {
    pub keyframes: Vec<Keyframe>,
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
    /// Selects the keyframes of the run in the folder `run`, and extracts their points from its recording. A learned mask is not
    /// applied.
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
        let estimate = read_trajectory(&run.join("trajectory.tum"))?;
        let capacity = configuration.odometry.points.capacity;
        let mut drive = Self {
            keyframes: Vec::new(),
            path_m: Vec::new(),
            refinement: configuration.odometry.refinement.clone(),
            capacity,
            submaps: [0, 1].map(|_| Submap::with_capacity(capacity * (2 * MAX_NEIGHBOURS + 1))),
            submap_reach_m: options.submap_reach_m,
        };
        drive.select(&configuration, &data, &estimate, options)?;
        let truth = read_trajectory(&truth)?;
        let stamps = estimate.stamp_ns.as_deref().unwrap_or_default();
        for keyframe in &mut drive.keyframes {
            keyframe.truth = truth.near(stamps[keyframe.scan], SAME_TIME_NS);
        }
        Ok(drive)
    }

    fn select(
        &mut self,
        configuration: &Configuration,
        data: &Path,
        estimate: &Trajectory,
        options: &PlaceOptions,
    ) -> Result<(), Failure> {
        let mut dataset = gyre_radar::open(data, &configuration.dataset)?;
        let (odometry, mut scan) = (
            &configuration.odometry,
            OwnedScan::with_limits(dataset.limits()),
        );
        let mut masker = Masker::new(&odometry.raster, &odometry.points, &odometry.masking)?;
        let mut selector = KeyframeSelector::new(options);
        let mut points = vec![SparsePoint::default(); self.capacity];
        let stamps = estimate.stamp_ns.as_deref().unwrap_or_default();
        for (k, pose) in estimate.poses.iter().enumerate() {
            let Some(path_m) = selector.next(pose) else {
                continue;
            };
            scan.geometry = dataset.read(k, scan.slot())?;
            if scan.geometry.stamp_ns.abs_diff(stamps[k]) > SAME_TIME_NS {
                return Err(format!(
                    "pose {k} is not that of scan {k}: the run must have used all scans"
                )
                .into());
            }
            let twist = twist(estimate, stamps, k);
            let count = masker.points(&scan.view(), Some(twist), &mut points)?;
            self.keyframes.push(Keyframe {
                scan: k,
                points: points[..count].to_vec(),
                pose: *pose,
                twist,
                truth: None,
            });
            self.path_m.push(path_m);
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
                &middle.pose.inv_mul(&other.pose),
            );
        }
    }
}

/// The velocity at pose `k`, from the poses around it.
fn twist(estimate: &Trajectory, stamps: &[i64], k: usize) -> Twist {
    let (before, after) = (k.saturating_sub(1), (k + 1).min(estimate.len() - 1));
    let motion = estimate.poses[before].inv_mul(&estimate.poses[after]);
    Twist::from_chord(&motion, (stamps[after] - stamps[before]) as f64 * 1e-9)
}
