//! A uniform grid of walls, which finds those between two points cell by cell.

use nalgebra::{Point2, Vector2};

use crate::body::Wall;

/// Side of a cell, metres: a few walls in each, some ten cells between the sensor and most
/// scatterers.
const CELL_M: f64 = 5.0;
/// Margin before the first wall, metres. Not a round number, since a wall along the edge of a cell
/// is not found from the cell beside it.
const MARGIN_M: f64 = 1.618_034;

#[derive(Clone, Debug)]
pub struct WallGrid {
    walls: Vec<Wall>,
    corner: Point2<f64>,
    columns: usize,
    rows: usize,
    /// The numbers of the walls in each cell.
    cells: Vec<Vec<u32>>,
}

impl WallGrid {
    pub fn new(walls: Vec<Wall>) -> Self {
        let ends = || walls.iter().flat_map(|wall| [wall.from, wall.to]);
        let lowest = ends().fold(Point2::new(0.0, 0.0), |a: Point2<f64>, b| a.inf(&b))
            - Vector2::repeat(MARGIN_M);
        let highest = ends().fold(Point2::new(0.0, 0.0), |a: Point2<f64>, b| a.sup(&b));
        let cells = |from: f64, to: f64| ((to - from) / CELL_M) as usize + 1;
        let (columns, rows) = (cells(lowest.x, highest.x), cells(lowest.y, highest.y));
        let mut grid = Self {
            walls,
            corner: lowest,
            columns,
            rows,
            cells: Vec::new(),
        };
        let mut cells: Vec<Vec<u32>> = vec![Vec::new(); columns * rows];
        for (index, wall) in grid.walls.iter().enumerate() {
            let mut walk = CellWalk::new(&grid, wall.from, wall.to);
            while let Some((column, row, _)) = walk.next_cell() {
                if let Some(cell) = grid.cell(column, row) {
                    cells[cell].push(index as u32);
                }
            }
        }
        grid.cells = cells;
        grid
    }

    fn cell(&self, column: i64, row: i64) -> Option<usize> {
        let inside =
            (0..self.columns as i64).contains(&column) && (0..self.rows as i64).contains(&row);
        inside.then(|| row as usize * self.columns + column as usize)
    }

    /// Visits the walls between two points, each once, with the share of the line up to the wall.
    pub fn between(&self, from: Point2<f64>, to: Point2<f64>, see: &mut impl FnMut(&Wall, f64)) {
        let mut walk = CellWalk::new(self, from, to);
        let mut entered = 0.0;
        while let Some((column, row, left)) = walk.next_cell() {
            let cell = self.cell(column, row);
            for &index in cell.into_iter().flat_map(|cell| &self.cells[cell]) {
                let wall = &self.walls[index as usize];
                // A wall lies in several cells, but the line crosses it in one of them only.
                if let Some(share) =
                    crossing(from, to - from, wall).filter(|share| (entered..left).contains(share))
                {
                    see(wall, share);
                }
            }
            entered = left;
        }
    }
}

pub fn crossing(from: Point2<f64>, line: Vector2<f64>, wall: &Wall) -> Option<f64> {
    let along = wall.to - wall.from;
    let determinant = line.perp(&along);
    if determinant == 0.0 {
        return None;
    }
    let offset = wall.from - from;
    let share = offset.perp(&along) / determinant;
    let on_wall = offset.perp(&line) / determinant;
    ((0.0..1.0).contains(&share) && (0.0..=1.0).contains(&on_wall)).then_some(share)
}

/// The cells along a line, in order (Amanatides and Woo 1987).
struct CellWalk {
    cell: [i64; 2],
    step: [i64; 2],
    /// Share of the line where it leaves the cell in x and in y.
    next: [f64; 2],
    /// Share of the line that lies in one cell in x and in y.
    stride: [f64; 2],
    done: bool,
}

impl CellWalk {
    fn new(grid: &WallGrid, from: Point2<f64>, to: Point2<f64>) -> Self {
        let start = (from - grid.corner) / CELL_M;
        let line = (to - from) / CELL_M;
        let mut walk = Self {
            cell: [0; 2],
            step: [0; 2],
            next: [f64::INFINITY; 2],
            stride: [f64::INFINITY; 2],
            done: false,
        };
        for axis in 0..2 {
            let floor = start[axis].floor();
            walk.cell[axis] = floor as i64;
            if line[axis] != 0.0 {
                walk.step[axis] = if line[axis] > 0.0 { 1 } else { -1 };
                walk.stride[axis] = 1.0 / line[axis].abs();
                let to_side = if line[axis] > 0.0 {
                    floor + 1.0 - start[axis]
                } else {
                    start[axis] - floor
                };
                walk.next[axis] = to_side * walk.stride[axis];
            }
        }
        walk
    }

    /// Column, row, and the share of the line where it leaves the cell (1 in the last).
    fn next_cell(&mut self) -> Option<(i64, i64, f64)> {
        if self.done {
            return None;
        }
        let axis = usize::from(self.next[1] < self.next[0]);
        let left = self.next[axis];
        let here = (self.cell[0], self.cell[1], left.min(1.0));
        self.done = left >= 1.0;
        self.cell[axis] += self.step[axis];
        self.next[axis] += self.stride[axis];
        Some(here)
    }
}

#[cfg(test)]
mod tests {
    use rand::{Rng, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    use super::*;

    fn point(rng: &mut ChaCha8Rng) -> Point2<f64> {
        Point2::new(rng.random_range(-60.0..60.0), rng.random_range(-60.0..60.0))
    }

    #[test]
    fn grid_finds_the_same_walls_as_a_search_through_all() {
        let mut rng = ChaCha8Rng::seed_from_u64(5);
        let wall = |i: u32, rng: &mut ChaCha8Rng| {
            let from = point(rng);
            let to =
                from + Vector2::new(rng.random_range(-15.0..15.0), rng.random_range(-15.0..15.0));
            Wall {
                from,
                to,
                transmission: 0.5,
                body: i % 7,
            }
        };
        let walls: Vec<Wall> = (0..120).map(|i| wall(i, &mut rng)).collect();
        let grid = WallGrid::new(walls.clone());
        let mut hits = 0;
        for _ in 0..500 {
            let (from, to) = (point(&mut rng), point(&mut rng));
            let crossed = |w: &&Wall| crossing(from, to - from, w).is_some();
            let count = walls.iter().filter(crossed).count();
            let mut found = 0;
            grid.between(from, to, &mut |_, _| found += 1);
            assert_eq!(found, count, "{from} to {to}");
            hits += count;
        }
        assert!(
            hits > 500,
            "the walls are dense enough to test something: {hits}"
        );
    }

    #[test]
    fn walls_along_the_axes_at_round_coordinates_hide_from_both_sides() {
        for at in [-20.0, -5.0, 0.0, 5.0, 10.0] {
            for (from, to) in [((at, -15.0), (at, 15.0)), ((-15.0, at), (15.0, at))]
                .map(|(a, b)| (point_at(a), point_at(b)))
            {
                let grid = WallGrid::new(vec![Wall {
                    from,
                    to,
                    transmission: 0.5,
                    body: 1,
                }]);
                let across = Vector2::new((to - from).y, (to - from).x) + Vector2::new(0.7, 0.7);
                let middle = nalgebra::center(&from, &to);
                for line in [across, -across] {
                    let mut found = 0;
                    grid.between(middle - line, middle + line, &mut |_, _| found += 1);
                    assert_eq!(found, 1, "{from} to {to}, {line}");
                }
            }
        }
    }

    fn point_at((x, y): (f64, f64)) -> Point2<f64> {
        Point2::new(x, y)
    }
}
