//! Changed places joined to things.

use std::collections::BTreeMap;

use nalgebra::{Point2, Rotation2};

use super::survey::{CELL_M, middle_m};

/// Cells that are at most so many apart along x and y are neighbours: the returns of a car are
/// those of its corners and edges.
const NEAR_CELLS: i64 = 2;
/// Directions of a rectangle that are tried, over a quarter of a turn.
const DIRECTIONS: i32 = 30;

/// Neighbouring places that have changed in the same sense.
pub(super) struct Cluster {
    /// The cells, at least one.
    pub cells: Vec<[i64; 2]>,
    /// The largest of their log odds.
    pub log_odds: f64,
}

/// The smallest rectangle around a cluster.
#[derive(Clone, Copy, Debug)]
pub(super) struct Outline {
    pub centre: Point2<f64>,
    /// The direction of the longer side, from -pi/2 to pi/2.
    pub yaw_rad: f64,
    pub length_m: f64,
    pub width_m: f64,
}

/// Joins neighbouring cells, each with its log odds.
pub(super) fn connected(places: &BTreeMap<[i64; 2], f64>) -> Vec<Cluster> {
    let mut left = places.clone();
    let mut clusters = Vec::new();
    while let Some((first, log_odds)) = left.pop_first() {
        let (mut cells, mut largest) = (vec![first], log_odds);
        let mut next = 0;
        while let Some(&[x, y]) = cells.get(next) {
            for beside in (-NEAR_CELLS..=NEAR_CELLS)
                .flat_map(|dx| (-NEAR_CELLS..=NEAR_CELLS).map(move |dy| [x + dx, y + dy]))
            {
                if let Some(log_odds) = left.remove(&beside) {
                    largest = largest.max(log_odds);
                    cells.push(beside);
                }
            }
            next += 1;
        }
        clusters.push(Cluster {
            cells,
            log_odds: largest,
        });
    }
    clusters
}

impl Cluster {
    /// Returns the smallest rectangle around its cells.
    pub fn outline(&self) -> Outline {
        let step_rad = std::f64::consts::FRAC_PI_2 / f64::from(DIRECTIONS);
        let outlines = (0..DIRECTIONS).map(|step| self.outline_at(f64::from(step) * step_rad));
        let area = |it: &Outline| it.length_m * it.width_m;
        let first = self.outline_at(0.0);
        outlines.fold(
            first,
            |best, it| if area(&it) < area(&best) { it } else { best },
        )
    }

    /// Returns the rectangle around its cells with a side in a direction.
    fn outline_at(&self, yaw_rad: f64) -> Outline {
        let turn = Rotation2::new(yaw_rad);
        let places = || {
            self.cells
                .iter()
                .map(|cell| turn.inverse() * middle_m(*cell))
        };
        let most = Point2::new(f64::MAX, f64::MAX);
        let low = places().fold(most, |a, b| a.inf(&b));
        let high = places().fold(-most, |a, b| a.sup(&b));
        let size = (high - low).add_scalar(CELL_M);
        let centre = turn * nalgebra::center(&low, &high);
        match size.x >= size.y {
            true => Outline {
                centre,
                yaw_rad,
                length_m: size.x,
                width_m: size.y,
            },
            false => Outline {
                centre,
                yaw_rad: yaw_rad - std::f64::consts::FRAC_PI_2,
                length_m: size.y,
                width_m: size.x,
            },
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cells_with_a_gap_of_one_are_one_thing_and_with_two_they_are_not() {
        let places = [([0, 0], 1.0), ([2, 1], 3.0), ([5, 1], 2.0)];
        let clusters = connected(&places.into_iter().collect());
        let sizes: Vec<_> = clusters
            .iter()
            .map(|it| (it.cells.len(), it.log_odds))
            .collect();
        assert_eq!(sizes, [(2, 3.0), (1, 2.0)]);
    }

    #[test]
    fn the_outline_of_a_slanted_bar_lies_along_it() {
        let cells: Vec<[i64; 2]> = (0..20).map(|k| [k, -k / 2]).collect();
        let outline = Cluster {
            cells,
            log_odds: 0.0,
        }
        .outline();
        assert!((outline.yaw_rad + 0.46).abs() < 0.06, "{outline:?}");
        assert!((outline.length_m - 11.0).abs() < 0.5, "{outline:?}");
        assert!(outline.width_m < 1.2, "{outline:?}");
        assert!(
            (outline.centre - Point2::new(5.0, -2.1)).norm() < 0.5,
            "{outline:?}"
        );
    }
}
