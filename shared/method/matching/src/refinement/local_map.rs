//! The local map: the last keyframes, and the sums of their images on a fine and a coarse level.

use std::collections::VecDeque;

use gyre_geometry::Pose;
use nalgebra::Vector2;
use ndarray::{ArrayView2, ArrayViewMut2};

use super::{
    RefinementConfig,
    config::COARSE,
    map_level::{Image, MapLevel, MapView},
    points::DeskewedPoints,
};

/// A scan becomes a keyframe at this distance or rotation from the last keyframe, m and degrees.
const KEYFRAME_DISTANCE_M: f64 = 1.5;
const KEYFRAME_ANGLE_DEG: f64 = 3.0;

#[derive(Debug, Clone)]
pub struct Keyframe {
    pub id: u64,
    /// Pose in the first scan's frame.
    pub pose: Pose,
    pub ahead_m: Vector2<f64>,
    images: [Image; 2],
}

impl Keyframe {
    /// Returns its fine and its coarse image, each with the map's cell (x, y) that its first value
    /// belongs to.
    ///
    /// Rows are of equal x, which grows with the row; y grows with the column. A cell is 0 where
    /// the scan saw nothing, and at most 255.
    pub fn images(&self) -> [([i64; 2], ArrayView2<'_, u8>); 2] {
        self.images.each_ref().map(|it| (it.corner, it.view()))
    }

    pub fn images_mut(&mut self) -> [(&mut [i64; 2], ArrayViewMut2<'_, u8>); 2] {
        self.images.each_mut().map(Image::parts_mut)
    }
}

#[derive(Debug)]
pub(super) struct LocalMap {
    levels: [MapLevel; 2],
    used: VecDeque<Keyframe>,
    spare: Vec<Keyframe>,
}

impl LocalMap {
    pub fn new(config: &RefinementConfig) -> Self {
        let cells_m = [config.cell_m, config.cell_m * COARSE];
        let levels = cells_m.map(|cell_m| MapLevel::new(cell_m, config.reach_m));
        let keyframe = Keyframe {
            id: 0,
            pose: Pose::identity(),
            ahead_m: Vector2::zeros(),
            images: levels.each_ref().map(MapLevel::new_image),
        };
        Self {
            levels,
            used: VecDeque::with_capacity(config.keyframes),
            spare: vec![keyframe; config.keyframes],
        }
    }

    pub fn keyframe_cells(&self) -> usize {
        self.levels.iter().map(|level| level.n.pow(2)).sum()
    }

    pub fn len(&self) -> usize {
        self.used.len()
    }

    pub fn is_empty(&self) -> bool {
        self.used.is_empty()
    }

    pub fn keyframes(&self) -> impl Iterator<Item = &Keyframe> {
        self.used.iter()
    }

    pub fn clear(&mut self) {
        self.spare.extend(self.used.drain(..));
        self.sum_images();
    }

    /// Adds a keyframe in place of the oldest one, if the map is full.
    pub fn insert(&mut self, id: u64, points: &DeskewedPoints, pose: &Pose, ahead_m: Vector2<f64>) {
        let oldest = self.spare.is_empty().then(|| self.used.pop_front());
        if let Some(oldest) = oldest.flatten() {
            for (level, image) in self.levels.iter_mut().zip(&oldest.images) {
                level.subtract(image);
            }
            self.spare.push(oldest);
        }
        let Some(mut keyframe) = self.spare.pop() else {
            return;
        };
        (keyframe.id, keyframe.pose, keyframe.ahead_m) = (id, *pose, ahead_m);
        for (k, level) in self.levels.iter_mut().enumerate() {
            level.draw(points, pose, &mut keyframe.images[k]);
            let others = self.used.iter().map(move |it| &it.images[k]);
            level.add_newest(&keyframe.images[k], others);
        }
        self.used.push_back(keyframe);
    }

    /// Replaces the keyframes by those that `load` fills in, oldest first, until it returns `false`
    /// or the map is full.
    pub fn restore(&mut self, mut load: impl FnMut(&mut Keyframe) -> bool) {
        self.clear();
        while let Some(mut keyframe) = self.spare.pop() {
            if !load(&mut keyframe) {
                self.spare.push(keyframe);
                break;
            }
            self.used.push_back(keyframe);
        }
        self.sum_images();
    }

    fn sum_images(&mut self) {
        for (k, level) in self.levels.iter_mut().enumerate() {
            level.sum_images(self.used.iter().map(move |it| &it.images[k]));
        }
    }

    pub fn fine(&self) -> MapView<'_> {
        self.levels[0].view()
    }

    pub fn coarse(&self) -> MapView<'_> {
        self.levels[1].view()
    }

    pub fn fine_images(&self) -> impl Iterator<Item = (&Image, Vector2<f64>)> {
        self.used.iter().map(|it| (&it.images[0], it.ahead_m))
    }

    /// Returns whether `pose` is far enough from the last keyframe for a new one, also by the
    /// search.
    pub fn needs_keyframe(&self, pose: &Pose, ahead_m: Vector2<f64>) -> bool {
        self.used.back().is_none_or(|last| {
            let moved = last.pose.inv_mul(pose);
            let moved_m = pose.translation.vector - last.pose.translation.vector;
            let by_search_m = moved_m + ahead_m - last.ahead_m;
            moved_m.norm().max(by_search_m.norm()) >= KEYFRAME_DISTANCE_M
                || moved.rotation.angle().abs() >= KEYFRAME_ANGLE_DEG.to_radians()
        })
    }
}

#[cfg(test)]
mod tests {
    use gyre_geometry::pose;

    use super::*;

    /// Keyframes come and go, and the map is cleared: it is the map of its last keyframes.
    #[test]
    fn the_sum_is_that_of_the_keyframes_in_the_map() {
        let config = RefinementConfig {
            keyframes: 3,
            reach_m: 20.0,
            ..RefinementConfig::default()
        };
        let points = DeskewedPoints {
            x_m: vec![3.0, -7.0, 11.0],
            y_m: vec![1.0, 9.0, -4.0],
            weight: vec![1.0, 2.0, 0.5],
        };
        let insert = |map: &mut LocalMap, id: u64| {
            let at = id as f64;
            let pose = pose(2.3 * at, -1.1 * at, 0.2 * at);
            map.insert(id, &points, &pose, Vector2::zeros());
        };
        let mut map = LocalMap::new(&config);
        (0..5).for_each(|id| insert(&mut map, id));
        map.clear();
        assert!(map.fine().sum.iter().all(|sum| *sum == 0));
        (5..12).for_each(|id| insert(&mut map, id));
        let mut last = LocalMap::new(&config);
        (9..12).for_each(|id| insert(&mut last, id));
        assert_eq!(map.fine().sum, last.fine().sum);
        assert_eq!(map.coarse().sum, last.coarse().sum);
        let kept: Vec<u64> = map.keyframes().map(|keyframe| keyframe.id).collect();
        assert_eq!(kept, [9, 10, 11]);
    }
}
