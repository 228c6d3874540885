//! The keyframes of the local map, on two levels.

use std::collections::VecDeque;

use gyre_geometry::Pose;
use ndarray::{ArrayView2, ArrayViewMut2};

use super::{
    RefinementConfig,
    level::{Image, Level, Lookup},
    sweep::Placed,
};

/// A scan that is part of the map.
#[derive(Debug, Clone)]
pub struct Keyframe {
    /// Number of its scan.
    pub id: u64,
    /// Its pose in the first scan's frame.
    pub pose: Pose,
    fine: Image,
    coarse: Image,
}

impl Keyframe {
    /// Returns its fine and its coarse image, each with the map's cell (x, y) that its first value belongs to.
    ///
    /// Rows are of equal x, which grows with the row; y grows with the column. A cell is 0 where the scan saw nothing,
    /// and at most 255.
    pub fn images(&self) -> [([i64; 2], ArrayView2<'_, u8>); 2] {
        [&self.fine, &self.coarse].map(|image| (image.corner, image.view()))
    }

    /// Returns the same images to be filled in.
    pub fn images_mut(&mut self) -> [(&mut [i64; 2], ArrayViewMut2<'_, u8>); 2] {
        [&mut self.fine, &mut self.coarse].map(Image::parts_mut)
    }
}

/// The last keyframes and their sum.
#[derive(Debug)]
pub(super) struct Keyframes {
    fine: Level,
    coarse: Level,
    used: VecDeque<Keyframe>,
    spare: Vec<Keyframe>,
}

impl Keyframes {
    pub fn new(config: &RefinementConfig) -> Self {
        let level = |cell_m| Level::new(cell_m, config.reach_m);
        let (fine, coarse) = (level(config.cell_m), level(config.cell_m * config.coarse));
        let keyframe = Keyframe {
            id: 0,
            pose: Pose::identity(),
            fine: fine.new_image(),
            coarse: coarse.new_image(),
        };
        let count = config.keyframes;
        Self {
            fine,
            coarse,
            used: VecDeque::with_capacity(count),
            spare: vec![keyframe; count],
        }
    }

    /// Cells of a keyframe's images together.
    pub fn cells(&self) -> usize {
        self.fine.n.pow(2) + self.coarse.n.pow(2)
    }

    pub fn is_empty(&self) -> bool {
        self.used.is_empty()
    }

    pub fn iter(&self) -> impl Iterator<Item = &Keyframe> {
        self.used.iter()
    }

    pub fn clear(&mut self) {
        self.spare.extend(self.used.drain(..));
    }

    /// Adds a keyframe, in place of the oldest where there are as many as may be.
    pub fn draw(&mut self, id: u64, points: &Placed, pose: &Pose) {
        let Some(mut keyframe) = self.spare.pop().or_else(|| self.used.pop_front()) else {
            return;
        };
        (keyframe.id, keyframe.pose) = (id, *pose);
        self.fine.draw(points, pose, &mut keyframe.fine);
        self.coarse.draw(points, pose, &mut keyframe.coarse);
        self.used.push_back(keyframe);
        self.stack();
    }

    /// Adds a keyframe that `load` fills in; returns whether there was room, and one to load.
    pub fn push(&mut self, load: &mut impl FnMut(&mut Keyframe) -> bool) -> bool {
        let Some(mut keyframe) = self.spare.pop() else {
            return false;
        };
        let loaded = load(&mut keyframe);
        if loaded {
            self.used.push_back(keyframe);
        } else {
            self.spare.push(keyframe);
        }
        loaded
    }

    /// Makes the map anew.
    pub fn stack(&mut self) {
        self.fine
            .stack(self.used.iter().map(|keyframe| &keyframe.fine));
        self.coarse
            .stack(self.used.iter().map(|keyframe| &keyframe.coarse));
    }

    pub fn fine(&self) -> Lookup<'_> {
        self.fine.lookup()
    }

    pub fn coarse(&self) -> Lookup<'_> {
        self.coarse.lookup()
    }

    /// Whether a scan at `pose` is far enough from the last keyframe to be one.
    pub fn is_far(&self, pose: &Pose, config: &RefinementConfig) -> bool {
        self.used.back().is_none_or(|last| {
            let moved = last.pose.inv_mul(pose);
            moved.translation.vector.norm() >= config.keyframe_distance_m
                || moved.rotation.angle().abs() >= config.keyframe_angle_deg.to_radians()
        })
    }
}
