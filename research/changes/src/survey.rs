//! The looks of one drive at each place, and what they saw there.

use std::{collections::BTreeMap, f64::consts::FRAC_1_SQRT_2};

use gyre_geometry::Pose;
use gyre_slam::{mapping::{MapOptions, TILE_CELLS, TileIndex, View}, Keyframe};
use nalgebra::Point2;

/// Side of a cell, m: a car is nine long and four wide.
pub(super) const CELL_M: f64 = 0.5;
/// Range up to which a keyframe is used, m. Farther away a beam is as wide as a car is long.
const REACH_M: f64 = 60.0;
/// A return marks the cells whose middles are within this distance of it, m, and as much more as
/// its bearing is uncertain: the cell that it is in at least.
const AROUND_M: f64 = CELL_M * FRAC_1_SQRT_2;
/// Power falls with the square of the range near by, where the receiver filters low beat
/// frequencies, and a weight of 1 is 30 dB: the weight that a thing loses with ten times the range.
const WEIGHT_PER_DECADE: f64 = 20.0 / 30.0;
/// Range at which a weight is a strength, m.
const STRENGTH_M: f64 = 20.0;
/// Strengths between which a return counts in part: a solid one, as of a car, whose corners have
/// some m²; and any, from 20 dB below.
const SOLID: [f32; 2] = [0.4, 0.8];
const ANY: [f32; 2] = [0.0, 0.2];
/// Looks from nearby of a cell that is well known.
const WELL_LOOKED: f32 = 16.0;
/// Planes of a drive.
pub(super) const PLANES: usize = 4;

/// The looks of a drive at each place, from its keyframes.
///
/// Memory: 1 MB for each square of 128 m that it has looked at.
pub struct Survey {
    view: View,
    /// Uncertainty of the bearing of a return.
    bearing_rad: f64,
    tiles: BTreeMap<TileIndex, Vec<Looks>>,
    window: Window,
}

/// The looks at a cell.
#[derive(Clone, Copy, Debug, Default)]
struct Looks {
    /// Number of looks, each weighed from 0 to 1 as it was from nearby.
    looked: f32,
    /// The sum of the strengths of what returned there, from 0 to the number of looks.
    strength: f32,
    /// That of the looks with any return, and with a solid one.
    any: f32,
    solid: f32,
}

impl Looks {
    /// Returns the values of the planes: looks, and the means of the others.
    fn values(self) -> [f32; PLANES] {
        let looked = self.looked.max(f32::MIN_POSITIVE);
        let mean = |sum: f32| (sum / looked).min(1.0);
        let known = (self.looked / WELL_LOOKED).min(1.0).sqrt();
        [known, mean(self.strength), mean(self.any), mean(self.solid)]
    }
}

impl Default for Survey {
    /// Starts without a keyframe. Places are looked at as in the training of the network, whatever
    /// the options of the map.
    fn default() -> Self {
        let options = MapOptions {
            cell_m: CELL_M,
            reach_m: REACH_M,
            ..MapOptions::default()
        };
        Self {
            view: View::new(&options),
            tiles: BTreeMap::new(),
            window: Window::new(REACH_M),
            bearing_rad: options.bearing_deg.to_radians(),
        }
    }
}

impl Survey {
    /// Adds a keyframe at `pose` in the frame of both drives.
    pub fn add(&mut self, keyframe: &Keyframe, pose: &Pose) {
        self.view.take(keyframe);
        self.mark_returns(pose);
        let (centre, inverse) = (Point2::from(pose.translation.vector), pose.inverse());
        for tile in TileIndex::around(&centre, REACH_M, CELL_M) {
            let entry = self.tiles.entry(tile);
            let places = entry.or_insert_with(|| vec![Looks::default(); TILE_CELLS * TILE_CELLS]);
            for (cell, looks) in cells(tile).zip(places) {
                let look = self.view.look(&(inverse * middle_m(cell)).coords) as f32;
                if look > 0.0 {
                    let strength = self.window.strongest(cell);
                    looks.looked += look;
                    looks.strength += look * strength.min(1.0);
                    looks.solid += look * counted(strength, SOLID);
                    looks.any += look * counted(strength, ANY);
                }
            }
        }
    }

    /// Marks the cells around each return with its strength.
    fn mark_returns(&mut self, pose: &Pose) {
        self.window.clear(&Point2::from(pose.translation.vector));
        for (place, weight) in self.view.points() {
            let around_m = AROUND_M + self.bearing_rad * place.norm();
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

    /// Returns the tiles that were looked at.
    pub(super) fn tiles(&self) -> impl Iterator<Item = TileIndex> + '_ {
        self.tiles.keys().copied()
    }

    /// Returns the corner and the size, in cells, of all that this drive or another one has looked
    /// at, for [`Survey::draw`].
    pub fn bounds(&self, other: &Self) -> ([i64; 2], [usize; 2]) {
        let corners = || self.tiles().chain(other.tiles()).map(TileIndex::corner);
        let least = |axis: usize| corners().map(|it| it[axis]).min().unwrap_or(0);
        let most = |axis: usize| corners().map(|it| it[axis]).max().unwrap_or(0);
        let corner = [0, 1].map(least);
        let size = [0, 1].map(|axis| (most(axis) - corner[axis]) as usize + TILE_CELLS);
        (corner, size)
    }

    /// Draws the cells from a corner on: four planes of `size[0]` rows along x and `size[1]`
    /// columns along y.
    ///
    /// They are how well each was looked at, the mean strength of the returns, and the shares of
    /// the looks with any return and with a solid one, all from 0 to 1.
    pub fn draw(&self, corner: [i64; 2], size: [usize; 2]) -> Vec<f32> {
        let area = size[0] * size[1];
        let mut planes = vec![0.0; PLANES * area];
        let side = TILE_CELLS as i64;
        let [xs, ys] = [0, 1].map(|axis| {
            let last = corner[axis] + size[axis] as i64 - 1;
            corner[axis].div_euclid(side) as i32..=last.div_euclid(side) as i32
        });
        let indices = xs.flat_map(|x| ys.clone().map(move |y| TileIndex { x, y }));
        let tiles = indices.filter_map(|index| Some((index, self.tiles.get(&index)?)));
        for (cell, looks) in tiles.flat_map(|(index, looks)| cells(index).zip(looks)) {
            let [row, column] = [0, 1].map(|axis| cell[axis] - corner[axis]);
            let [rows, columns] = size.map(|cells| 0..cells as i64);
            if looks.looked > 0.0 && rows.contains(&row) && columns.contains(&column) {
                let at = row as usize * size[1] + column as usize;
                for (plane, value) in looks.values().into_iter().enumerate() {
                    planes[plane * area + at] = value;
                }
            }
        }
        planes
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

    /// Returns the strength of the strongest return in a cell; 0 without any.
    fn strongest(&self, cell: [i64; 2]) -> f32 {
        self.index(cell).map_or(0.0, |index| self.strongest[index])
    }
}
