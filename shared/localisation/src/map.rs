//! The keyframes of a map.

use gyre_estimation::places::{
    Candidate, Describer, Descriptor, MAX_NEIGHBOURS, OrderError, PlaceIndex, neighbours,
};
use gyre_geometry::Pose;
use gyre_scan_matching::Submap;
use gyre_slam::Keyframe;
use nalgebra::Point2;
use thiserror::Error;

/// Keyframes that make no map.
#[derive(Clone, Copy, Debug, PartialEq, Error)]
pub enum MapError {
    /// There is none.
    #[error("a map needs keyframes: there is none")]
    Empty,
    /// Their number is not that of their poses.
    #[error(
        "a map needs a pose for each keyframe: there are {keyframes} keyframes and {poses} poses"
    )]
    Poses {
        /// Number of keyframes.
        keyframes: usize,
        /// Number of poses.
        poses: usize,
    },
    /// They are not in the order of the path.
    #[error(transparent)]
    Order(#[from] OrderError),
}

/// Keyframes with their poses in the map's frame, and what their submaps look like.
pub struct Map {
    keyframes: Vec<Keyframe>,
    poses: Vec<Pose>,
    path_m: Vec<f64>,
    submap_reach_m: f64,
    index: PlaceIndex,
}

impl Map {
    /// Describes all keyframes of a drive. `poses` are their poses in the map's frame; the keyframes within `submap_reach_m` along the
    /// path either way make the submap of one.
    ///
    /// # Errors
    /// No keyframes, another number of poses, or keyframes that are not in the order of the path.
    pub fn new(
        keyframes: Vec<Keyframe>,
        poses: Vec<Pose>,
        submap_reach_m: f64,
    ) -> Result<Self, MapError> {
        if keyframes.is_empty() {
            return Err(MapError::Empty);
        }
        if keyframes.len() != poses.len() {
            return Err(MapError::Poses {
                keyframes: keyframes.len(),
                poses: poses.len(),
            });
        }
        let mut map = Self {
            path_m: keyframes.iter().map(|keyframe| keyframe.path_m).collect(),
            index: PlaceIndex::with_capacity(keyframes.len()),
            keyframes,
            poses,
            submap_reach_m,
        };
        let (mut submap, mut describer) = (map.new_submap(), Describer::new());
        let mut descriptor = Descriptor::default();
        for k in 0..map.keyframes.len() {
            map.draw(k, &mut submap);
            describer.describe(&submap, &mut descriptor);
            map.index.insert(k as u64, map.path_m[k], &descriptor)?;
        }
        Ok(map)
    }

    /// The keyframes, in the order of the path.
    pub fn keyframes(&self) -> &[Keyframe] {
        &self.keyframes
    }

    /// The poses of the keyframes.
    pub fn poses(&self) -> &[Pose] {
        &self.poses
    }

    /// The keyframe nearest to a place, and its distance, m.
    pub fn nearest(&self, place: Point2<f64>) -> (usize, f64) {
        let distance_m = |pose: &Pose| (pose.translation.vector - place.coords).norm();
        let all = self.poses.iter().map(distance_m).enumerate();
        all.min_by(|a, b| a.1.total_cmp(&b.1))
            .unwrap_or((0, f64::INFINITY))
    }

    /// The keyframes whose submaps look most like a descriptor, `apart_m` from each other along the path.
    pub(crate) fn similar(&mut self, descriptor: &Descriptor, apart_m: f64) -> &[Candidate] {
        self.index.query(descriptor, usize::MAX, apart_m)
    }

    /// Makes the submap around a keyframe.
    pub(crate) fn draw(&self, middle: usize, submap: &mut Submap) {
        let keyframe = &self.keyframes[middle];
        submap.start(&keyframe.points, &keyframe.twist);
        for k in neighbours(&self.path_m, middle, self.submap_reach_m).filter(|k| *k != middle) {
            let other = &self.keyframes[k];
            let pose = self.poses[middle].inv_mul(&self.poses[k]);
            submap.add(&other.points, &other.twist, &pose);
        }
    }

    /// A submap with room for that of any keyframe.
    pub(crate) fn new_submap(&self) -> Submap {
        Submap::with_capacity(self.largest() * (2 * MAX_NEIGHBOURS + 1))
    }

    /// The largest number of points of a keyframe.
    pub(crate) fn largest(&self) -> usize {
        let points = self.keyframes.iter().map(|keyframe| keyframe.points.len());
        points.max().unwrap_or(0)
    }
}
