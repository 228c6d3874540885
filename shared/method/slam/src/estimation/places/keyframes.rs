//! Selection of keyframes, and the keyframes of a submap.

use std::ops::Range;

use gyre_geometry::Pose;

/// Largest number of keyframes of a submap to each side of the middle one. A vehicle that turns on
/// the spot makes many keyframes.
pub const MAX_NEIGHBOURS: usize = 8;
/// Length of the path to each side of a keyframe whose keyframes make its submap, m.
pub const SUBMAP_REACH_M: f64 = 10.0;
/// A scan becomes a keyframe at this distance or rotation from the last keyframe, m and degrees.
const DISTANCE_M: f64 = 2.0;
const ANGLE_DEG: f64 = 15.0;

/// Selects the scans that become keyframes, and measures the path along them. The first scan
/// becomes one.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct KeyframeSelector {
    last: Option<(Pose, f64)>,
}

impl KeyframeSelector {
    pub fn resume(&mut self, pose: Pose, path_m: f64) {
        self.last = Some((pose, path_m));
    }

    /// Takes the odometry's pose of the next scan. If it becomes a keyframe, returns the length of
    /// the path through all keyframes up to it, m.
    pub fn next(&mut self, pose: &Pose) -> Option<f64> {
        let path_m = match &self.last {
            None => 0.0,
            Some((last, path_m)) => {
                let motion = last.inv_mul(pose);
                let distance_m = motion.translation.vector.norm();
                let angle_rad = motion.rotation.angle().abs();
                if distance_m < DISTANCE_M && angle_rad < ANGLE_DEG.to_radians() {
                    return None;
                }
                path_m + distance_m
            }
        };
        self.last = Some((*pose, path_m));
        Some(path_m)
    }
}

/// Returns the keyframes of the submap around keyframe `middle`: those within `reach_m` along the
/// path, at most [`MAX_NEIGHBOURS`] to each side. The submap is complete once a keyframe behind
/// these is known.
pub fn neighbours(path_m: &[f64], middle: usize, reach_m: f64) -> Range<usize> {
    let Some(&here) = path_m.get(middle) else {
        return 0..0;
    };
    let first = path_m.partition_point(|at| *at < here - reach_m);
    let end = path_m.partition_point(|at| *at <= here + reach_m);
    first.max(middle.saturating_sub(MAX_NEIGHBOURS))..end.min(middle + MAX_NEIGHBOURS + 1)
}

#[cfg(test)]
mod tests {
    use gyre_geometry::pose;

    use super::*;

    #[test]
    fn two_metres_or_fifteen_degrees_make_a_keyframe() {
        let mut selector = KeyframeSelector::default();
        let poses = [
            (0.0, 0.0),
            (1.9, 0.0),
            (2.1, 0.0),
            (2.1, 14.0),
            (2.1, 16.0),
            (4.0, 16.0),
            (4.2, 16.0),
        ];
        let mut next =
            |(x, degrees): (f64, f64)| selector.next(&pose(x, 0.0, degrees.to_radians()));
        let found: Vec<Option<f64>> = poses.into_iter().map(&mut next).collect();
        let path = [Some(0.0), None, Some(2.1), None, Some(2.1), None, Some(4.2)];
        for (found, expected) in found.iter().zip(path) {
            assert_eq!(found.is_some(), expected.is_some());
            let apart = found.unwrap_or(0.0) - expected.unwrap_or(0.0);
            assert!(apart.abs() < 1e-9, "{found:?} {expected:?}");
        }
    }

    #[test]
    fn a_submap_is_ten_metres_of_the_path_either_way() {
        let path: Vec<f64> = (0..20).map(|k| 2.0 * f64::from(k)).collect();
        assert_eq!(neighbours(&path, 10, 10.0), 5..16);
        assert_eq!(neighbours(&path, 1, 10.0), 0..7);
        assert_eq!(neighbours(&path, 19, 10.0), 14..20);
        assert_eq!(neighbours(&[0.0; 40], 20, 10.0), 12..29);
        assert_eq!(neighbours(&path, 20, 10.0), 0..0);
    }
}
