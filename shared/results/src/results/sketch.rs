//! The path to be drawn, reduced to the number of poses that a picture needs.

use crate::evaluation::{EvaluationError, plot::path_svg};
use gyre_geometry::Pose;

/// Up to twice as many poses are drawn.
const ENOUGH: usize = 1 << 15;

/// A path that is thinned as it grows: of a long one every 2nd, 4th, 8th, ... pose is kept, and the
/// last one.
#[derive(Debug, Default)]
pub struct Sketch {
    kept: Vec<Pose>,
    halvings: u32,
    poses: usize,
    pub length_m: f64,
    last: Option<Pose>,
}

impl Sketch {
    pub fn add(&mut self, pose: Pose) {
        if let Some(last) = &self.last {
            let step = pose.translation.vector - last.translation.vector;
            self.length_m += step.norm();
        }
        if self.poses.is_multiple_of(1 << self.halvings) {
            self.kept.push(pose);
        }
        self.poses += 1;
        self.last = Some(pose);
        if self.kept.len() > 2 * ENOUGH {
            let mut index = 0..;
            self.kept
                .retain(|_| index.next().is_some_and(|k: usize| k.is_multiple_of(2)));
            self.halvings += 1;
        }
    }

    pub fn path(&self) -> Vec<Pose> {
        let last = self.poses.saturating_sub(1);
        let last_is_kept = last.is_multiple_of(1 << self.halvings);
        let last = self.last.filter(|_| !last_is_kept);
        self.kept.iter().copied().chain(last).collect()
    }

    /// Returns the plot as an SVG document; `None` without poses.
    pub fn svg(&self) -> Result<Option<String>, EvaluationError> {
        let drawn = self.path();
        match drawn.is_empty() {
            true => Ok(None),
            false => path_svg(&drawn, self.poses, self.length_m).map(Some),
        }
    }
}

#[cfg(test)]
mod tests {
    use crate::evaluation::path_m;
    use gyre_geometry::pose;

    use super::*;

    fn poses(count: usize) -> impl Iterator<Item = Pose> {
        (0..count).map(|k| pose(k as f64, (k % 7) as f64, 0.0))
    }

    fn sketch(count: usize) -> Sketch {
        let mut sketch = Sketch::default();
        poses(count).for_each(|pose| sketch.add(pose));
        sketch
    }

    #[test]
    fn a_path_of_usual_length_is_drawn_whole() {
        let whole: Vec<Pose> = poses(500).collect();
        let expected = path_svg(&whole, 500, path_m(&whole)).unwrap();
        assert_eq!(sketch(500).svg().unwrap().unwrap(), expected);
        assert!(sketch(0).svg().unwrap().is_none());
    }

    #[test]
    fn a_long_path_is_thinned_evenly_and_keeps_its_ends() {
        for count in [2 * ENOUGH + 1, 5 * ENOUGH + 3, 9 * ENOUGH] {
            let sketch = sketch(count);
            assert!(sketch.kept.len() <= 2 * ENOUGH, "{count}");
            assert_eq!(sketch.kept.len(), count.div_ceil(1 << sketch.halvings));
            assert_eq!(sketch.kept.first(), poses(1).last().as_ref());
            let svg = sketch.svg().unwrap().unwrap();
            assert!(svg.contains(&format!("{count} poses")), "{count}");
        }
    }
}
