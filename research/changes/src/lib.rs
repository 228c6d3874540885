//! The changes between two drives through one place: what has appeared, and what has gone.
//!
//! - `survey`: [`Survey`], how one drive saw each place;
//! - `clusters`: changed places joined to things with an outline.
//!
//! # Method
//! 1. Each drive is drawn into cells of 0.5 m. A keyframe that looks at a cell adds its strongest
//!    return there, weighed as the look; free space is a look without a return. Strengths are those
//!    of a thing at 20 m, so that they tell what it is and not how far it is away. Of each cell
//!    there are how well it was looked at, the mean strength, and the shares of the looks with any
//!    return and with a solid one.
//! 2. A network is shown both drives, a square of 192 m at once, and says of each cell how likely a
//!    car stood in it on the first one and none does on the second one. It was trained on simulated
//!    pairs: it knows what a car looks like from a few sides, and what undergrowth that has grown
//!    anew, traffic, speckle and shadows look like instead. What has appeared is gone with the
//!    drives exchanged.
//! 3. Neighbouring places that may have changed in the same sense are one thing, with the largest
//!    log odds of its places as confidence. What one drive did not look at is not compared.

mod clusters;
mod survey;

use std::{collections::{BTreeMap, BTreeSet}, fmt};

use clusters::Cluster;
use gyre_masking::networks::{PlanesError, PlanesNetwork};
use gyre_slam::{mapping::{TILE_CELLS, TileIndex}, localisation::PlacedDrive};
use serde::Serialize;
pub use survey::Survey;
use survey::{CELL_M, PLANES};

/// The network, and its name in messages.
const NETWORK: &[u8] = include_bytes!("../changes.onnx");
const NAME: &str = "research/changes/changes.onnx";
/// The least that both drives know of a place that is compared: two thirds of a look from nearby.
const LEAST_KNOWN: f32 = 0.2;
/// The logarithm of the odds from which on a place may have changed, and that of the likeliest
/// place of a change that is reported.
const LEAST_LOG_ODDS: f32 = -1.5;
const CERTAIN_LOG_ODDS: f64 = 0.0;
/// Cells of the least change that is reported.
const MIN_CELLS: usize = 4;
/// Cells around a tile that the network is shown too.
const MARGIN: usize = 64;
/// Cells a side that it is shown.
const SIDE: usize = TILE_CELLS + 2 * MARGIN;

/// Stretches of the path, 5 m long, to either side of a fix within which odometry hardly leaves it:
/// 20 m.
const STRETCH_M: f64 = 5.0;
const NEAR_STRETCHES: u64 = 4;

/// Returns for each keyframe, by its place along the path, whether it is near one whose fix agrees
/// with the others: then its place relative to the map is known.
pub fn near_fixes(path_m: &[f64], placed: &PlacedDrive) -> Vec<bool> {
    let stretch = |keyframe: usize| (path_m[keyframe] / STRETCH_M) as u64;
    let fixed = placed.agreeing.iter().map(|it| stretch(it.keyframe));
    let fixed: BTreeSet<u64> = fixed.collect();
    let is_near = |keyframe: usize| {
        let at = stretch(keyframe);
        let near = at.saturating_sub(NEAR_STRETCHES)..=at + NEAR_STRETCHES;
        fixed.range(near).next().is_some()
    };
    (0..path_m.len()).map(is_near).collect()
}

/// The sense of a change.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum ChangeKind {
    /// It was free on the earlier drive, and is occupied on the later one.
    Appeared,
    /// It was occupied on the earlier drive, and is free on the later one.
    Gone,
}

impl fmt::Display for ChangeKind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Appeared => "appeared",
            Self::Gone => "gone",
        })
    }
}

/// A thing that has appeared or gone: the smallest rectangle around its changed places.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Change {
    /// The sense.
    pub kind: ChangeKind,
    /// The centre in the frame of both drives, m.
    pub x_m: f64,
    /// The centre in the frame of both drives, m.
    pub y_m: f64,
    /// The direction of its longer side, rad, from -pi/2 to pi/2.
    pub yaw_rad: f64,
    /// The longer side of the rectangle, m.
    pub length_m: f64,
    /// The shorter side of the rectangle, m.
    pub width_m: f64,
    /// The probability that it has changed, from 0.5 to 1.
    pub confidence: f64,
}

/// The changes between two drives.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Changes {
    /// The area that both drives have looked at, m².
    pub compared_m2: f64,
    /// The changes, the most certain first.
    pub changes: Vec<Change>,
}

/// Returns what has appeared and gone between two drives.
///
/// # Errors
/// The network cannot be computed.
pub fn changes(earlier: &Survey, later: &Survey) -> Result<Changes, PlanesError> {
    let shapes = [[2 * PLANES, SIDE, SIDE], [1, SIDE, SIDE]];
    let mut network = PlanesNetwork::of(NAME, NETWORK, None, shapes)?;
    let (mut gone, mut appeared) = (BTreeMap::new(), BTreeMap::new());
    let mut compared = 0;
    let of_later: BTreeSet<TileIndex> = later.tiles().collect();
    for tile in earlier.tiles().filter(|tile| of_later.contains(tile)) {
        let corner = tile.corner().map(|at| at - MARGIN as i64);
        let drawn = [earlier, later].map(|survey| survey.draw(corner, [SIDE; 2]));
        let [before, after] = drawn.each_ref().map(Vec::as_slice);
        let is_compared = |at: usize| before[at] >= LEAST_KNOWN && after[at] >= LEAST_KNOWN;
        let cells: Vec<(usize, [i64; 2])> = cells(corner).filter(|it| is_compared(it.0)).collect();
        compared += cells.len();
        if cells.is_empty() {
            continue;
        }
        for (drives, changed) in [
            ([before, after], &mut gone),
            ([after, before], &mut appeared),
        ] {
            let log_odds = log_odds(&mut network, &drives.concat())?;
            let likely = cells.iter().filter(|it| log_odds[it.0] > LEAST_LOG_ODDS);
            changed.extend(likely.map(|(at, cell)| (*cell, f64::from(log_odds[*at]))));
        }
    }
    let found = |kind, places: &BTreeMap<_, _>| {
        let clusters = clusters::connected(places).into_iter();
        let found = clusters.filter_map(|cluster| change(kind, &cluster));
        found.collect::<Vec<Change>>()
    };
    let mut changes = [
        found(ChangeKind::Gone, &gone),
        found(ChangeKind::Appeared, &appeared),
    ]
    .concat();
    changes.sort_by(|a, b| {
        let by_confidence = b.confidence.total_cmp(&a.confidence);
        by_confidence.then(a.x_m.total_cmp(&b.x_m))
    });
    Ok(Changes {
        compared_m2: compared as f64 * CELL_M * CELL_M,
        changes,
    })
}

/// Returns the mean of what the network says of both drives as they are and mirrored, the logarithm
/// of the odds of each cell: it errs in other places then.
fn log_odds(network: &mut PlanesNetwork, planes: &[f32]) -> Result<Vec<f32>, PlanesError> {
    const SIDES: [[bool; 2]; 4] = [[false, false], [false, true], [true, false], [true, true]];
    let mut mean = vec![0.0; SIDE * SIDE];
    for sides in SIDES {
        let said = mirrored(&network.compute(&mirrored(planes, sides))?, sides);
        let share = 1.0 / SIDES.len() as f32;
        mean.iter_mut()
            .zip(said)
            .for_each(|(mean, said)| *mean += share * said);
    }
    Ok(mean)
}

/// Mirrors planes of SIDE x SIDE cells: their rows, their columns, both or neither.
fn mirrored(planes: &[f32], [rows, columns]: [bool; 2]) -> Vec<f32> {
    let mut mirrored = planes.to_vec();
    for plane in mirrored.chunks_exact_mut(SIDE * SIDE) {
        if rows != columns {
            plane.chunks_exact_mut(SIDE).for_each(<[f32]>::reverse);
        }
        if rows {
            plane.reverse();
        }
    }
    mirrored
}

/// Returns the cells of a tile with their numbers in the square that the network is shown, whose
/// first cell is `corner`.
fn cells(corner: [i64; 2]) -> impl Iterator<Item = (usize, [i64; 2])> {
    let inner = MARGIN..SIDE - MARGIN;
    let places = inner
        .clone()
        .flat_map(move |row| inner.clone().map(move |column| [row, column]));
    places.map(move |[row, column]| {
        let cell = [corner[0] + row as i64, corner[1] + column as i64];
        (row * SIDE + column, cell)
    })
}

/// Returns the change that a cluster is, if it is large enough.
fn change(kind: ChangeKind, cluster: &Cluster) -> Option<Change> {
    let outline = cluster.outline();
    let is_one = cluster.cells.len() >= MIN_CELLS && cluster.log_odds >= CERTAIN_LOG_ODDS;
    is_one.then(|| Change {
        kind,
        x_m: outline.centre.x,
        y_m: outline.centre.y,
        yaw_rad: outline.yaw_rad,
        length_m: outline.length_m,
        width_m: outline.width_m,
        confidence: 1.0 / (1.0 + (-cluster.log_odds).exp()),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn planes_are_mirrored_by_rows_and_by_columns_and_back() {
        let mut planes = vec![0.0; 2 * SIDE * SIDE];
        planes[SIDE * SIDE + 3 * SIDE + 5] = 1.0;
        for (sides, [row, column]) in [
            ([false, false], [3, 5]),
            ([true, false], [SIDE - 4, 5]),
            ([false, true], [3, SIDE - 6]),
            ([true, true], [SIDE - 4, SIDE - 6]),
        ] {
            let there = mirrored(&planes, sides);
            assert_eq!(there[SIDE * SIDE + row * SIDE + column], 1.0, "{sides:?}");
            assert_eq!(mirrored(&there, sides), planes);
        }
    }
}
