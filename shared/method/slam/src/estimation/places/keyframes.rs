//! The keyframes of a submap.

use std::ops::Range;

/// Largest number of keyframes of a submap to each side of the middle one. A vehicle that turns on
/// the spot makes many keyframes.
pub const MAX_NEIGHBOURS: usize = 8;
/// Length of the path to each side of a keyframe whose keyframes make its submap, m.
pub const SUBMAP_REACH_M: f64 = 10.0;

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
    use super::*;

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
