use std::path::Path;

use gyre_geometry::Pose;
use nalgebra::Point2;

use crate::{
    Keyframe,
    mapping::{Evidence, MapError, MapOptions, Overlay, map_png},
};

/// Odometry's trajectory is drawn if it is somewhere this many cells away from the corrected one:
/// nearer lines coincide.
const APART_CELLS: f64 = 3.0;

/// The map of keyframes in the frame of the first one that is drawn. Poses are given in one other
/// frame.
pub struct Drawing {
    evidence: Evidence,
    first: Option<[Pose; 2]>,
    odometry: Vec<Pose>,
    is_corrected: bool,
}

impl Drawing {
    /// Starts without a keyframe. What does not fit into memory lies in a file in `folder`, which
    /// has no name.
    pub fn new(options: &MapOptions, folder: &Path) -> Result<Self, MapError> {
        Ok(Self {
            evidence: Evidence::new(options, folder)?,
            first: None,
            odometry: Vec::new(),
            is_corrected: false,
        })
    }

    pub fn draw(&mut self, keyframe: &Keyframe, pose: &Pose) -> Result<(), MapError> {
        let odometry = keyframe.pose.motion;
        let [first, by_odometry] = self.first.get_or_insert([*pose, odometry]);
        let (pose, odometry) = (first.inv_mul(pose), by_odometry.inv_mul(&odometry));
        self.evidence.draw(keyframe, &pose)?;
        let apart_m = (pose.translation.vector - odometry.translation.vector).norm();
        self.is_corrected |= apart_m > APART_CELLS * self.evidence.options().cell_m;
        self.odometry.push(odometry);
        Ok(())
    }

    pub fn evidence(&mut self) -> &mut Evidence {
        &mut self.evidence
    }

    pub fn keyframes(&self) -> usize {
        self.odometry.len()
    }

    /// Returns the picture of the map as a PNG file, with the trajectory and both ends of each
    /// loop, and with odometry's trajectory if it differs.
    pub fn png(&mut self, trajectory: &[Pose], loops: &[[Pose; 2]]) -> Result<Vec<u8>, MapError> {
        let map_from_given = self
            .first
            .map_or(Pose::identity(), |[first, _]| first.inverse());
        let trajectory: Vec<Pose> = trajectory
            .iter()
            .map(|pose| map_from_given * pose)
            .collect();
        let place = |pose: Pose| Point2::from((map_from_given * pose).translation.vector);
        let loops: Vec<[Point2<f64>; 2]> = loops.iter().map(|ends| ends.map(place)).collect();
        let overlay = Overlay {
            trajectory: &[&trajectory],
            odometry: match self.is_corrected {
                true => &self.odometry,
                false => &[],
            },
            loops: &loops,
        };
        map_png(&mut self.evidence, &overlay)
    }
}
