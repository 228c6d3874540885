//! Pairs as files that the network is trained with: `research/training/gyre_training/changes.py`.

use std::fs;
use std::path::Path;

use gyre_changes::ChangeKind;
use gyre_geometry::Pose;
use gyre_slam::Keyframe;

use crate::{Outcome, Pair};

impl Pair {
    /// Writes what the network is trained with as numbers of 4 bytes: corner and size of both
    /// drives' cells, the number of cars that have come or gone, a row for each (1 if gone, x, y,
    /// yaw in the frame of the first drive, length, width, 1 if in sight), and the planes of both
    /// drives.
    pub fn draw(&self, file: &Path) -> Outcome<()> {
        let surveys = self.surveys();
        let (corner, size) = surveys[0].bounds(&surveys[1]);
        let cars = self.changed_cars();
        let mut values: Vec<f32> = corner.iter().map(|it| *it as f32).collect();
        values.extend([size[0], size[1], cars.len()].map(|it| it as f32));
        for car in &cars {
            let pose = self.in_map(&car.car.pose);
            let [length_m, width_m] = car.car.size_m();
            let at = pose.translation.vector;
            let is_gone = f64::from(car.kind == ChangeKind::Gone);
            let in_sight = f64::from(u8::from(car.is_in_sight));
            let yaw_rad = pose.rotation.angle();
            let row = [is_gone, at.x, at.y, yaw_rad, length_m, width_m, in_sight];
            values.extend(row.map(|it| it as f32));
        }
        for survey in &surveys {
            values.extend(survey.draw(corner, size));
        }
        let bytes: Vec<u8> = values.iter().flat_map(|it| it.to_le_bytes()).collect();
        fs::write(file, bytes)?;
        Ok(())
    }

    /// A pose of the world in the frame of the first drive: that of its nearest keyframe.
    fn in_map(&self, of_car: &Pose) -> Pose {
        let true_pose = |it: &Keyframe| self.drives[0].pose(it.scan as usize);
        let distance_m =
            |it: &&Keyframe| (true_pose(it).translation.vector - of_car.translation.vector).norm();
        let nearest = self.keyframes[0]
            .iter()
            .min_by(|a, b| distance_m(a).total_cmp(&distance_m(b)));
        nearest.map_or(*of_car, |it| {
            it.pose.motion * true_pose(it).inverse() * of_car
        })
    }
}
