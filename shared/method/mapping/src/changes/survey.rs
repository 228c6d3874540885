//! The looks of one drive at each place, and what they saw there.

use std::collections::BTreeMap;
use std::f64::consts::FRAC_1_SQRT_2;

use gyre_geometry::Pose;
use gyre_slam::Keyframe;
use nalgebra::Point2;

use crate::tile::{CELLS, TILE_CELLS, TileIndex};
use crate::view::View;
use crate::{MapOptions, OptionError};

/// Side of a cell, m: a car is nine long and four wide.
pub(super) const CELL_M: f64 = 0.5;
/// Range up to which a keyframe is used, m. Farther away a beam is as wide as a car is long.
const REACH_M: f64 = 60.0;
/// A return marks the cells whose middles are within this distance of it, m, and as much more as
/// its bearing is uncertain: the cell that it is in at least.
const AROUND_M: f64 = CELL_M * FRAC_1_SQRT_2;
/// A thing is still there if something returns from a cell that is at most so many cells away:
/// leaves and branches are never at the same places again.
const AROUND_CELLS: i64 = 1;
/// Power falls with the square of the range near by, where the receiver filters low beat
/// frequencies, and a weight of 1 is 30 dB: the weight that a thing loses with ten times the range.
const WEIGHT_PER_DECADE: f64 = 20.0 / 30.0;
/// Range at which a weight is a strength, m.
const STRENGTH_M: f64 = 20.0;
/// Strengths between which a return counts in part: a solid one, as of a car, whose corners have
/// some m²; and any, from 20 dB below.
const SOLID: [f32; 2] = [0.4, 0.8];
const ANY: [f32; 2] = [0.0, 0.2];
/// Length of the stretches of the path that the halves of a drive have in turn, m.
const STRETCH_M: f64 = 10.0;

/// The looks of a drive at each place, from its keyframes.
///
/// Memory: 1 MB for each square of 128 m that it has looked at.
pub struct Survey {
    options: MapOptions,
    view: View,
    tiles: BTreeMap<TileIndex, Vec<Place>>,
    window: Window,
}

/// The looks of both halves of the drive at a cell.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Place([Looks; 2]);

/// The looks at a cell.
#[derive(Clone, Copy, Debug, Default)]
struct Looks {
    /// Number of looks, each weighed from 0 to 1 as it was from nearby.
    looked: f32,
    /// The sum of their solid returns there, from 0 to the number of looks.
    solid: f32,
    /// That of any returns.
    any: f32,
}

impl Looks {
    /// Returns the shares of the looks with a solid return and with any; `None` for fewer looks
    /// than `min_looked`.
    fn share(self, min_looked: f64) -> Option<[f64; 2]> {
        let looked = f64::from(self.looked);
        let share = |sum: f32| (f64::from(sum) / looked).min(1.0);
        (looked >= min_looked).then(|| [self.solid, self.any].map(share))
    }
}

impl Place {
    fn share(self, part: Part, min_looked: f64) -> Option<[f64; 2]> {
        let [one, other] = self.0;
        let looks = match part {
            Part::Half(half) => self.0[half],
            Part::Whole => Looks {
                looked: one.looked + other.looked,
                solid: one.solid + other.solid,
                any: one.any + other.any,
            },
        };
        looks.share(min_looked)
    }
}

/// A cell that was looked at twice, and how it was then.
#[derive(Clone, Copy, Debug)]
pub(super) struct Pair {
    /// The numbers of the cell along x and y.
    pub cell: [i64; 2],
    /// The share of the looks of the one with a solid return.
    pub own: f64,
    /// The largest share of those of the other one with any return, there and in the cells around.
    pub other: f64,
}

/// The looks that are taken together: those of one half of the drive, or all.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Part {
    Half(usize),
    Whole,
}

impl Survey {
    /// Starts without a keyframe. Of the options the cells do not matter.
    ///
    /// # Errors
    /// An option that is out of bounds.
    pub fn new(options: &MapOptions) -> Result<Self, OptionError> {
        let options = MapOptions {
            cell_m: CELL_M,
            reach_m: options.reach_m.min(REACH_M),
            ..options.clone()
        };
        options.validate()?;
        Ok(Self {
            view: View::new(&options),
            tiles: BTreeMap::new(),
            window: Window::new(options.reach_m),
            options,
        })
    }

    /// Adds a keyframe at `pose` in the frame of both drives.
    pub fn add(&mut self, keyframe: &Keyframe, pose: &Pose) {
        self.view.take(keyframe);
        self.mark_returns(pose);
        let half = (keyframe.path_m / STRETCH_M) as usize % 2;
        let (centre, inverse) = (Point2::from(pose.translation.vector), pose.inverse());
        for tile in TileIndex::around(&centre, self.options.reach_m, CELL_M) {
            let entry = self.tiles.entry(tile);
            let places = entry.or_insert_with(|| vec![Place::default(); CELLS]);
            for (cell, place) in cells(tile).zip(places) {
                let look = self.view.look(&(inverse * middle_m(cell)).coords) as f32;
                if look > 0.0 {
                    let looks = &mut place.0[half];
                    looks.looked += look;
                    let strength = self.window.strongest(cell);
                    looks.solid += look * counted(strength, SOLID);
                    looks.any += look * counted(strength, ANY);
                }
            }
        }
    }

    /// Marks the cells around each return with its strength.
    fn mark_returns(&mut self, pose: &Pose) {
        self.window.clear(&Point2::from(pose.translation.vector));
        let bearing_rad = self.options.bearing_deg.to_radians();
        for (place, weight) in self.view.points() {
            let around_m = AROUND_M + bearing_rad * place.norm();
            let strength = weight + WEIGHT_PER_DECADE * (place.norm() / STRENGTH_M).log10();
            let at = pose * Point2::from(place);
            let [least, most] = [-around_m, around_m].map(|by| cell_at(&at.map(|it| it + by)));
            for y in least[1]..=most[1] {
                for x in least[0]..=most[0] {
                    if (middle_m([x, y]) - at).norm() <= around_m {
                        self.window.mark([x, y], strength as f32);
                    }
                }
            }
        }
    }

    /// Returns the cells that this drive and another one, or two parts of one drive, have looked at
    /// so often, tile by tile.
    pub(super) fn pairs<'a>(
        &'a self,
        part: Part,
        (other, other_part): (&'a Self, Part),
        min_looked: f64,
    ) -> impl Iterator<Item = Pair> + 'a {
        let seen = self
            .tiles
            .iter()
            .flat_map(|(tile, places)| cells(*tile).zip(places));
        seen.filter_map(move |(cell, place)| {
            let [own, _] = place.share(part, min_looked)?;
            let other = other.around(cell, other_part, min_looked)?;
            Some(Pair { cell, own, other })
        })
    }

    /// Returns the largest share in the cells around one; `None` if that one was not looked at so
    /// often.
    fn around(&self, [x, y]: [i64; 2], part: Part, min_looked: f64) -> Option<f64> {
        let [_, mut largest] = self.share([x, y], part, min_looked)?;
        for dy in -AROUND_CELLS..=AROUND_CELLS {
            for dx in -AROUND_CELLS..=AROUND_CELLS {
                if dx * dx + dy * dy <= AROUND_CELLS * AROUND_CELLS {
                    let share = self.share([x + dx, y + dy], part, min_looked);
                    largest = largest.max(share.map_or(0.0, |it| it[1]));
                }
            }
        }
        Some(largest)
    }

    fn share(&self, [x, y]: [i64; 2], part: Part, min_looked: f64) -> Option<[f64; 2]> {
        let side = TILE_CELLS as i64;
        let tile = TileIndex {
            x: x.div_euclid(side) as i32,
            y: y.div_euclid(side) as i32,
        };
        let index = y.rem_euclid(side) * side + x.rem_euclid(side);
        self.tiles.get(&tile)?[index as usize].share(part, min_looked)
    }
}

/// Returns how much of a return of a strength counts, from 0 to 1.
fn counted(strength: f32, [none, all]: [f32; 2]) -> f32 {
    ((strength - none) / (all - none)).clamp(0.0, 1.0)
}

/// The cells of a tile, row after row, that of the lowest y first.
fn cells(tile: TileIndex) -> impl Iterator<Item = [i64; 2]> {
    let [x, y] = tile.corner();
    let side = TILE_CELLS as i64;
    (0..side).flat_map(move |row| (0..side).map(move |column| [x + column, y + row]))
}

/// Returns the cell of a place.
fn cell_at(place: &Point2<f64>) -> [i64; 2] {
    [place.x, place.y].map(|at_m| (at_m / CELL_M).floor() as i64)
}

/// Returns the middle of a cell, m.
pub(super) fn middle_m([x, y]: [i64; 2]) -> Point2<f64> {
    Point2::new(x as f64 + 0.5, y as f64 + 0.5) * CELL_M
}

/// The cells around a keyframe, with the strongest return in each.
struct Window {
    corner: [i64; 2],
    side: i64,
    strongest: Vec<f32>,
}

impl Window {
    fn new(reach_m: f64) -> Self {
        let side = 2 * (reach_m / CELL_M).ceil() as i64 + 3;
        Self {
            corner: [0; 2],
            side,
            strongest: vec![0.0; (side * side) as usize],
        }
    }

    /// Moves the window to a place, without returns.
    fn clear(&mut self, centre: &Point2<f64>) {
        self.corner = cell_at(centre).map(|cell| cell - self.side / 2);
        self.strongest.fill(0.0);
    }

    fn index(&self, cell: [i64; 2]) -> Option<usize> {
        let [x, y] = [0, 1].map(|axis| cell[axis] - self.corner[axis]);
        let inside = (0..self.side).contains(&x) && (0..self.side).contains(&y);
        inside.then_some((y * self.side + x) as usize)
    }

    fn mark(&mut self, cell: [i64; 2], weight: f32) {
        if let Some(index) = self.index(cell) {
            let strongest = &mut self.strongest[index];
            *strongest = strongest.max(weight);
        }
    }

    /// Returns the strongest return in a cell, from 0 to 1.
    fn strongest(&self, cell: [i64; 2]) -> f32 {
        self.index(cell).map_or(0.0, |index| self.strongest[index])
    }
}
