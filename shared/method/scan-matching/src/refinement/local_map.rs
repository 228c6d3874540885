//! The local map: the last keyframes, and the sums of their images on a fine and a coarse level.

use std::collections::VecDeque;

use gyre_geometry::Pose;
use nalgebra::Vector2;
use ndarray::{ArrayView2, ArrayViewMut2};

use super::{
    RefinementConfig,
    config::COARSE,
    map_level::{Image, ImageView, MapLevel, MapView},
    points::DeskewedPoints,
};

/// A scan becomes a keyframe at this distance or rotation from the last keyframe, m and degrees.
const KEYFRAME_DISTANCE_M: f64 = 1.5;
const KEYFRAME_ANGLE_DEG: f64 = 3.0;

/// A scan that is part of the local map.
#[derive(Debug, Clone)]
pub struct Keyframe {
    pub id: u64,
    /// Pose in the first scan's frame.
    pub pose: Pose,
    /// [`super::TrackerState::ahead_m`] of its scan.
    pub ahead_m: Vector2<f64>,
    fine: Image,
    coarse: Image,
}

impl Keyframe {
    /// Returns its fine and its coarse image, each with the map's cell (x, y) that its first value
    /// belongs to.
    ///
    /// Rows are of equal x, which grows with the row; y grows with the column. A cell is 0 where
    /// the scan saw nothing, and at most 255.
    pub fn images(&self) -> [([i64; 2], ArrayView2<'_, u8>); 2] {
        [&self.fine, &self.coarse].map(|image| (image.corner, image.view()))
    }

    pub fn images_mut(&mut self) -> [(&mut [i64; 2], ArrayViewMut2<'_, u8>); 2] {
        [&mut self.fine, &mut self.coarse].map(Image::parts_mut)
    }
}

#[derive(Debug)]
pub(super) struct LocalMap {
    fine: MapLevel,
    coarse: MapLevel,
    used: VecDeque<Keyframe>,
    spare: Vec<Keyframe>,
}

impl LocalMap {
    pub fn new(config: &RefinementConfig) -> Self {
        let level = |cell_m| MapLevel::new(cell_m, config.reach_m);
        let (fine, coarse) = (level(config.cell_m), level(config.cell_m * COARSE));
        let keyframe = Keyframe {
            id: 0,
            pose: Pose::identity(),
            ahead_m: Vector2::zeros(),
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

    /// Cells of both images of a keyframe.
    pub fn keyframe_cells(&self) -> usize {
        self.fine.n.pow(2) + self.coarse.n.pow(2)
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
            self.fine.subtract(&oldest.fine);
            self.coarse.subtract(&oldest.coarse);
            self.spare.push(oldest);
        }
        let Some(mut keyframe) = self.spare.pop() else {
            return;
        };
        (keyframe.id, keyframe.pose, keyframe.ahead_m) = (id, *pose, ahead_m);
        self.fine.draw(points, pose, &mut keyframe.fine);
        self.coarse.draw(points, pose, &mut keyframe.coarse);
        let used = self.used.iter();
        self.fine
            .add_newest(&keyframe.fine, used.clone().map(|other| &other.fine));
        self.coarse
            .add_newest(&keyframe.coarse, used.map(|other| &other.coarse));
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
        self.fine
            .sum_images(self.used.iter().map(|keyframe| &keyframe.fine));
        self.coarse
            .sum_images(self.used.iter().map(|keyframe| &keyframe.coarse));
    }

    pub fn fine(&self) -> MapView<'_> {
        self.fine.view()
    }

    /// The fine image of each keyframe, and its [`Keyframe::ahead_m`].
    pub fn fine_images(&self) -> impl Iterator<Item = (ImageView<'_>, Vector2<f64>)> {
        let cell_m = self.fine.cell_m;
        let used = self.used.iter();
        used.map(move |it| (ImageView::new(&it.fine, cell_m), it.ahead_m))
    }

    pub fn coarse(&self) -> MapView<'_> {
        self.coarse.view()
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

    /// Keyframes come and go, the map is cleared and filled again: the sum equals the sum of its
    /// keyframes.
    #[test]
    fn the_sum_is_that_of_the_keyframes_in_the_map() {
        let config = RefinementConfig {
            keyframes: 3,
            reach_m: 20.0,
            ..RefinementConfig::default()
        };
        let mut map = LocalMap::new(&config);
        let points = DeskewedPoints {
            x_m: vec![3.0, -7.0, 11.0],
            y_m: vec![1.0, 9.0, -4.0],
            weight: vec![1.0, 2.0, 0.5],
        };
        for id in 0..12 {
            if id == 5 {
                map.clear();
                assert!(map.fine().sum.iter().all(|sum| *sum == 0));
            }
            let at = id as f64;
            map.insert(
                id,
                &points,
                &pose(2.3 * at, -1.1 * at, 0.2 * at),
                Vector2::zeros(),
            );
            let kept = [map.fine().sum.to_vec(), map.coarse().sum.to_vec()];
            map.sum_images();
            assert_eq!(kept, [map.fine().sum, map.coarse().sum], "{id}");
        }
        assert_eq!(
            map.keyframes().map(|k| k.id).collect::<Vec<_>>(),
            [9, 10, 11]
        );
    }
}
