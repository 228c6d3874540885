//! Polylines in the plane, indexed by place.

use std::collections::HashMap;

use nalgebra::{Point2, Vector2};

/// Side of a cell of [`LineGrid`], metres.
const CELL_M: f64 = 16.0;

/// A polyline.
pub type Line = Vec<Point2<f64>>;

/// A segment of a polyline in a [`LineGrid`].
#[derive(Clone, Copy, Debug)]
pub struct Segment {
    /// Number of its line.
    pub line: usize,
    /// Number of its first point.
    pub point: usize,
    from: Point2<f64>,
    to: Point2<f64>,
}

impl Segment {
    /// Unit vector along the segment; zero if its ends coincide.
    pub fn direction(&self) -> Vector2<f64> {
        (self.to - self.from).try_normalize(0.0).unwrap_or_default()
    }

    /// The projection of a place: 0 at the first end, 1 at the other.
    pub fn share(&self, place: Point2<f64>) -> f64 {
        let segment = self.to - self.from;
        (place - self.from).dot(&segment) / segment.norm_squared().max(1e-12)
    }

    /// The nearest point of the segment.
    pub fn foot(&self, place: Point2<f64>) -> Point2<f64> {
        self.from + (self.to - self.from) * self.share(place).clamp(0.0, 1.0)
    }

    /// Metres to the left of the segment's line.
    pub fn left_m(&self, place: Point2<f64>) -> f64 {
        self.direction().perp(&(place - self.from))
    }
}

/// Segments indexed by place; more can be added.
#[derive(Debug, Default)]
pub struct LineGrid {
    cells: HashMap<(i64, i64), Vec<Segment>>,
}

impl LineGrid {
    /// Adds the segment of a line that begins at `point`.
    pub fn add(&mut self, line: usize, point: usize, from: Point2<f64>, to: Point2<f64>) {
        let (low, high) = (cell(from.inf(&to)), cell(from.sup(&to)));
        for column in low.0..=high.0 {
            for row in low.1..=high.1 {
                self.cells.entry((column, row)).or_default().push(Segment {
                    line,
                    point,
                    from,
                    to,
                });
            }
        }
    }

    /// Adds a whole line.
    pub fn add_line(&mut self, number: usize, line: &[Point2<f64>]) {
        for (point, ends) in line.windows(2).enumerate() {
            self.add(number, point, ends[0], ends[1]);
        }
    }

    /// The segments within `reach_m` of a place, by cell and in the order in which they were added;
    /// some more than once.
    pub fn near(&self, place: Point2<f64>, reach_m: f64) -> impl Iterator<Item = &Segment> {
        let reach = Vector2::repeat(reach_m);
        let (low, high) = (cell(place - reach), cell(place + reach));
        (low.0..=high.0)
            .flat_map(move |column| (low.1..=high.1).map(move |row| (column, row)))
            .filter_map(|key| self.cells.get(&key))
            .flatten()
            .filter(move |segment| (segment.foot(place) - place).norm() < reach_m)
    }
}

fn cell(place: Point2<f64>) -> (i64, i64) {
    (
        (place.x / CELL_M).floor() as i64,
        (place.y / CELL_M).floor() as i64,
    )
}

/// Length of a line, metres.
pub fn length_m(line: &[Point2<f64>]) -> f64 {
    line.windows(2).map(|ends| (ends[1] - ends[0]).norm()).sum()
}

/// The line without points within `tolerance_m` of the line through the others (Douglas and
/// Peucker, 1973).
pub fn simplified(line: &[Point2<f64>], tolerance_m: f64) -> Line {
    let mut keep = vec![false; line.len()];
    let mut open = vec![(0, line.len().saturating_sub(1))];
    while let Some((first, last)) = open.pop() {
        (keep[first], keep[last]) = (true, true);
        let chord = Segment {
            line: 0,
            point: 0,
            from: line[first],
            to: line[last],
        };
        let off = |index: &usize| (chord.foot(line[*index]) - line[*index]).norm();
        let farthest = (first + 1..last).max_by(|a, b| off(a).total_cmp(&off(b)));
        if let Some(middle) = farthest.filter(|index| off(index) > tolerance_m) {
            open.extend([(first, middle), (middle, last)]);
        }
    }
    line.iter()
        .zip(keep)
        .filter_map(|(point, keep)| keep.then_some(*point))
        .collect()
}
