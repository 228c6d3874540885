//! What a radar can see: scatterers that reflect, walls that hide.

use nalgebra::{Isometry2, Point2, Vector2};

use crate::occlusion::WallGrid;

/// The body of a thing that belongs to nothing larger.
pub const NO_BODY: u32 = 0;

/// Which way a scatterer reflects.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Aspect {
    /// The same to all sides: posts, leaves, corners of cars.
    AllRound,
    /// To one side: power falls with the cosine of the angle from `normal`, raised to `sharpness`
    /// (1 to 2: rough walls; 300: a smooth panel that flashes within some degrees).
    Facing {
        /// Unit vector, world frame.
        normal: Vector2<f64>,
        /// Exponent of the cosine.
        sharpness: f64,
    },
}

impl Aspect {
    /// Share of the power that goes towards `direction`, a unit vector from the scatterer to the sensor: 0 to 1.
    pub fn gain(&self, direction: Vector2<f64>) -> f64 {
        match *self {
            Self::AllRound => 1.0,
            Self::Facing { normal, sharpness } => normal.dot(&direction).max(0.0).powf(sharpness),
        }
    }

    /// The same on average over all directions: the mean of a cosine's power over a circle, about
    /// `1 / sqrt(2 pi (sharpness + 0.64))`.
    pub fn mean_gain(&self) -> f64 {
        match *self {
            Self::AllRound => 1.0,
            Self::Facing { sharpness, .. } => {
                1.0 / (std::f64::consts::TAU * (sharpness + 0.64)).sqrt()
            }
        }
    }
}

/// A point that reflects.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Scatterer {
    /// Where, world frame, metres.
    pub position: Point2<f64>,
    /// Radar cross-section, square metres.
    pub cross_section_m2: f64,
    /// Which way it reflects.
    pub aspect: Aspect,
    /// What it is a part of: walls of the same body do not hide it. [`NO_BODY`] where it stands alone.
    pub body: u32,
}

/// A straight wall that lets a part of the power through.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Wall {
    /// One end, world frame, metres.
    pub from: Point2<f64>,
    /// The other end.
    pub to: Point2<f64>,
    /// Share of the power that passes, there and back: 0 (nothing) to 1.
    pub transmission: f64,
    /// Share of the power that it mirrors: 0 (rough) to 1 (a sheet of metal).
    pub mirror: f64,
    /// What it is a part of.
    pub body: u32,
}

impl Scatterer {
    /// The same scatterer on a body that stands at `pose`.
    pub fn moved(&self, pose: &Isometry2<f64>) -> Self {
        let aspect = match self.aspect {
            Aspect::AllRound => Aspect::AllRound,
            Aspect::Facing { normal, sharpness } => Aspect::Facing {
                normal: pose * normal,
                sharpness,
            },
        };
        Self {
            position: pose * self.position,
            aspect,
            ..*self
        }
    }
}

impl Wall {
    /// The same wall on a body that stands at `pose`.
    pub fn moved(&self, pose: &Isometry2<f64>) -> Self {
        Self {
            from: pose * self.from,
            to: pose * self.to,
            ..*self
        }
    }
}

/// A thing made of scatterers and walls.
#[derive(Clone, Debug, Default)]
pub struct Body {
    /// What reflects.
    pub scatterers: Vec<Scatterer>,
    /// What hides.
    pub walls: Vec<Wall>,
}

impl Body {
    /// Adds all of another body.
    pub fn extend(&mut self, other: Body) {
        self.scatterers.extend(other.scatterers);
        self.walls.extend(other.walls);
    }
}

/// A body on its way.
#[derive(Clone, Copy, Debug)]
pub struct Moving<'a> {
    /// What it is made of, in its own frame (x ahead); its number is its own among all movers and the town.
    pub body: &'a Body,
    /// Where its frame is in the world at the time asked for.
    pub pose: Isometry2<f64>,
    /// Velocity of that frame in the world, metres a second.
    pub velocity: Vector2<f64>,
}

impl Moving<'_> {
    /// Where its frame is `time_s` seconds later. Turning is left out: a sweep is short.
    pub fn pose_after(&self, time_s: f64) -> Isometry2<f64> {
        Isometry2::from_parts(
            (self.pose.translation.vector + self.velocity * time_s).into(),
            self.pose.rotation,
        )
    }
}

/// What moves around the sensor.
pub trait Movers: Send + Sync {
    /// Shows all bodies within `reach_m` of `centre` at a time of the drive, always in the same order.
    fn visit<'a>(
        &'a self,
        time_s: f64,
        centre: Point2<f64>,
        reach_m: f64,
        see: &mut dyn FnMut(Moving<'a>),
    );
}

/// Nothing moves.
impl Movers for () {
    fn visit<'a>(&'a self, _: f64, _: Point2<f64>, _: f64, _: &mut dyn FnMut(Moving<'a>)) {}
}

/// Metres a side of the tiles that scatterers are sorted into.
const TILE_M: f64 = 16.0;

/// All that stands still around the sensor, ready to be looked at.
#[derive(Clone, Debug)]
pub struct World {
    /// Tile by tile, and in a tile in the order given.
    scatterers: Vec<Scatterer>,
    corner: Point2<f64>,
    columns: usize,
    rows: usize,
    /// `tile_start[t]..tile_start[t + 1]` are the scatterers of tile `t`.
    tile_start: Vec<usize>,
    walls: WallGrid,
}

impl World {
    /// A world of these scatterers and walls.
    pub fn new(content: Body) -> Self {
        let Body {
            mut scatterers,
            walls,
        } = content;
        let places = || scatterers.iter().map(|scatterer| scatterer.position);
        let origin = Point2::origin();
        let corner = places().fold(origin, |a, b| a.inf(&b));
        let size = (places().fold(origin, |a, b| a.sup(&b)) - corner) / TILE_M;
        let (columns, rows) = (size.x as usize + 1, size.y as usize + 1);
        let tile = |scatterer: &Scatterer| {
            let place = (scatterer.position - corner) / TILE_M;
            place.y as usize * columns + place.x as usize
        };
        scatterers.sort_by_cached_key(tile);
        let mut tile_start = vec![0; columns * rows + 1];
        for scatterer in &scatterers {
            tile_start[tile(scatterer) + 1] += 1;
        }
        for index in 1..tile_start.len() {
            tile_start[index] += tile_start[index - 1];
        }
        Self {
            scatterers,
            corner,
            columns,
            rows,
            tile_start,
            walls: WallGrid::new(walls),
        }
    }

    /// All that reflects.
    pub fn scatterers(&self) -> &[Scatterer] {
        &self.scatterers
    }

    /// Runs of scatterers that hold all within `reach_m` of a place, and some beyond.
    pub fn around(&self, place: Point2<f64>, reach_m: f64) -> impl Iterator<Item = &[Scatterer]> {
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
        let (top, bottom) = span(low.y, high.y, self.rows);
        let row = move |row: usize| {
            let tile = row * self.columns;
            &self.scatterers[self.tile_start[tile + first]..self.tile_start[tile + end.max(first)]]
        };
        (top..bottom).map(row)
    }

    /// All that hides.
    pub fn walls(&self) -> &[Wall] {
        self.walls.walls()
    }

    /// Share of the power that passes between two points, there and back; walls of `body` count for nothing.
    /// Stops with a value below `negligible` as soon as so little is left.
    pub fn transmission(
        &self,
        from: Point2<f64>,
        to: Point2<f64>,
        body: u32,
        negligible: f64,
    ) -> f64 {
        self.walls.transmission(from, to, body, negligible)
    }

    /// Shows the walls between two points, each once: its number in [`World::walls`], and the share of the way to it.
    pub fn walls_between(
        &self,
        from: Point2<f64>,
        to: Point2<f64>,
        see: &mut impl FnMut(u32, &Wall, f64),
    ) {
        self.walls.between(from, to, see);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn all_that_is_near_is_among_what_is_around() {
        let at = |i: i32, j: i32| Point2::new(f64::from(i) * 7.3 - 90.0, f64::from(j) * 9.1 - 40.0);
        let scatterer = |position| Scatterer {
            position,
            cross_section_m2: 1.0,
            aspect: Aspect::AllRound,
            body: NO_BODY,
        };
        let scatterers = (0..40)
            .flat_map(|i| (0..20).map(move |j| scatterer(at(i, j))))
            .collect();
        let world = World::new(Body {
            scatterers,
            walls: vec![],
        });
        assert_eq!(world.scatterers().len(), 800);
        for (place, reach_m) in [
            ((0.0, 0.0), 30.0),
            ((-300.0, 20.0), 250.0),
            ((190.0, 130.0), 5.0),
            ((0.0, 900.0), 9.0),
        ] {
            let place = Point2::new(place.0, place.1);
            let near = |s: &&Scatterer| (s.position - place).norm() <= reach_m;
            let found = world.around(place, reach_m).flatten().filter(near).count();
            assert_eq!(found, world.scatterers().iter().filter(near).count());
        }
    }
}
