use nalgebra::Point2;

use crate::body::{Body, Scatterer};
use crate::occlusion::WallGrid;

/// Metres a side of the tiles that scatterers are sorted into.
const TILE_M: f64 = 16.0;

#[derive(Clone, Debug)]
pub struct World {
    /// The scatterers of each tile in the given order, row by row.
    tiles: Vec<Vec<Scatterer>>,
    corner: Point2<f64>,
    columns: usize,
    pub walls: WallGrid,
}

impl World {
    pub fn new(content: Body) -> Self {
        let Body { scatterers, walls } = content;
        let places = || scatterers.iter().map(|scatterer| scatterer.position);
        let origin = Point2::origin();
        let corner = places().fold(origin, |a, b| a.inf(&b));
        let size = (places().fold(origin, |a, b| a.sup(&b)) - corner) / TILE_M;
        let (columns, rows) = (size.x as usize + 1, size.y as usize + 1);
        let mut tiles = vec![Vec::new(); columns * rows];
        for scatterer in scatterers {
            let place = (scatterer.position - corner) / TILE_M;
            tiles[place.y as usize * columns + place.x as usize].push(scatterer);
        }
        Self {
            tiles,
            corner,
            columns,
            walls: WallGrid::new(walls),
        }
    }

    /// Scatterers that include all within `reach_m` of a place, and some beyond.
    pub fn around(&self, place: Point2<f64>, reach_m: f64) -> impl Iterator<Item = &Scatterer> {
        let low = (place - self.corner).add_scalar(-reach_m) / TILE_M;
        let high = (place - self.corner).add_scalar(reach_m) / TILE_M;
        let span = |low: f64, high: f64, end: usize| {
            let clamp = |v: f64| v.floor().clamp(-1.0, end as f64);
            (
                clamp(low).max(0.0) as usize,
                (clamp(high) + 1.0).clamp(0.0, end as f64) as usize,
            )
        };
        let (first, end) = span(low.x, high.x, self.columns);
        let rows = self.tiles.len() / self.columns;
        let (top, bottom) = span(low.y, high.y, rows);
        let rows = self.tiles.chunks(self.columns).take(bottom).skip(top);
        rows.flat_map(move |row| row[first..end.max(first)].iter().flatten())
    }

    /// Two-way share of the power that passes between two points; walls of `body` are ignored.
    pub fn transmission(&self, from: Point2<f64>, to: Point2<f64>, body: u32) -> f64 {
        let mut passed = 1.0;
        self.walls.between(from, to, &mut |wall, _| {
            if wall.body != body {
                passed *= wall.transmission;
            }
        });
        passed
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::body::NO_BODY;

    #[test]
    fn around_includes_all_that_is_near() {
        let at = |i: i32, j: i32| Point2::new(f64::from(i) * 7.3 - 90.0, f64::from(j) * 9.1 - 40.0);
        let scatterer = |position| Scatterer::all_round(position, 1.0, NO_BODY);
        let scatterers = (0..40)
            .flat_map(|i| (0..20).map(move |j| scatterer(at(i, j))))
            .collect();
        let world = World::new(Body {
            scatterers,
            walls: Vec::new(),
        });
        let all = || world.tiles.iter().flatten();
        assert_eq!(all().count(), 800);
        for (place, reach_m) in [
            ((0.0, 0.0), 30.0),
            ((-300.0, 20.0), 250.0),
            ((190.0, 130.0), 5.0),
            ((0.0, 900.0), 9.0),
        ] {
            let place = Point2::new(place.0, place.1);
            let near = |s: &&Scatterer| (s.position - place).norm() <= reach_m;
            let found = world.around(place, reach_m).filter(near).count();
            assert_eq!(found, all().filter(near).count());
        }
    }
}
