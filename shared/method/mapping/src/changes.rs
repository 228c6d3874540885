//! The changes between two drives through one place: what has appeared, and what has gone.
//!
//! - `survey`: [`Survey`], how much each place returned of how often one drive looked at it;
//! - `noise`: how far two looks at one unchanged place differ, learnt from both drives;
//! - `clusters`: changed places joined to things with an outline.
//!
//! # Method
//! 1. Each drive is drawn into cells of 0.5 m. A keyframe that looks at a cell adds its strongest
//!    return there, weighed as the look; free space is a look without a return. Strengths are those
//!    of a thing at 20 m, so that they tell what it is and not how far it is away. Two sums are
//!    kept: of solid returns, as of a car, and of any, as of leaves and kerbs.
//! 2. A place that is occupied by something solid in the one drive is compared with what the other
//!    one saw there and half a metre around, however weak: branches and leaves are never at the
//!    same places again.
//! 3. Between two halves of one drive, stretches of the path in turn, nothing has changed: how
//!    often both see such shares together is what two looks at one place may show. Of a place that
//!    has changed they see two things that have nothing to do with each other. The ratio of both is
//!    the evidence of a change. So what is seen at some angles only, traffic and speckle are as
//!    uncertain as they are in these two drives.
//! 4. The share of the occupied places that have changed is that by which both drives are most
//!    likely (expectation and maximisation).
//! 5. A place has changed if it is occupied in one drive and free in the other, and that is more
//!    likely than not. What one drive did not look at is neither.
//! 6. Neighbouring places that have changed in the same sense are one thing. One of the size of a
//!    car or more is reported, with the mean of the log odds of its places as confidence: they are
//!    seen by the same looks, and so are no independent witnesses.

mod clusters;
mod noise;
mod survey;

use std::collections::BTreeMap;
use std::fmt;

use nalgebra::{Point2, Vector2};
use serde::Serialize;

use clusters::{Cluster, Odds};
use noise::Noise;
pub use survey::Survey;
use survey::{CELL_M, Pair, Part};

/// Looks from nearby of each drive at a place that is compared.
const MIN_LOOKED: f64 = 4.0;
/// The share of the looks with a solid return from which on a place is occupied, as
/// [`Occupancy`](crate::Occupancy) has it.
const OCCUPIED: f64 = 1.0 / 16.0;
/// The share of the looks with any return below which a place is free.
const FREE: f64 = 0.4;
/// A change that is reported has a side of this length, m, returns in this share of its looks, and
/// an area of which what returned in each look would fill this, m²: of a parked car those sides are
/// seen that face the road.
const MIN_LENGTH_M: f64 = 2.0;
const MIN_SHARE: f64 = 0.2;
const MIN_RETURNED_M2: f64 = 0.8;

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
    /// The area of its changed places, m².
    pub area_m2: f64,
    /// The mean share of the looks at its places that returned power, on the drive on which it
    /// stood: that of a wall is near 1, and that of a few leaves near 0.
    pub share: f64,
    /// The probability that it has changed, from 0.5 to 1.
    pub confidence: f64,
}

impl Change {
    /// Returns the corners of its rectangle in the frame of both drives, m.
    pub fn corners(&self) -> [Point2<f64>; 4] {
        let along = Vector2::new(self.yaw_rad.cos(), self.yaw_rad.sin()) * (0.5 * self.length_m);
        let across = Vector2::new(-self.yaw_rad.sin(), self.yaw_rad.cos()) * (0.5 * self.width_m);
        let centre = Point2::new(self.x_m, self.y_m);
        [
            along + across,
            along - across,
            -along - across,
            across - along,
        ]
        .map(|by| centre + by)
    }
}

/// The changes between two drives.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Changes {
    /// The area that both drives have looked at, m².
    pub compared_m2: f64,
    /// The share of the occupied places that have changed, by the drives themselves.
    pub changed_share: f64,
    /// The changes, the most certain first.
    pub changes: Vec<Change>,
}

/// Returns what has appeared and gone between two drives.
pub fn changes(earlier: &Survey, later: &Survey) -> Changes {
    let noise = Noise::learn([earlier, later]);
    let whole = |survey| (survey, Part::Whole);
    let gone = earlier
        .pairs(Part::Whole, whole(later), MIN_LOOKED)
        .collect();
    let appeared = later
        .pairs(Part::Whole, whole(earlier), MIN_LOOKED)
        .collect();
    let pairs: [(ChangeKind, Vec<Pair>); 2] =
        [(ChangeKind::Gone, gone), (ChangeKind::Appeared, appeared)];
    let compared = pairs[0].1.len();
    let occupied = pairs.iter().flat_map(|(_, pairs)| pairs);
    let changed_share = noise.changed_share(occupied.filter(|pair| pair.own >= OCCUPIED));
    let changed = pairs.iter().flat_map(|(kind, pairs)| {
        let places = changed_places(pairs, &noise, changed_share);
        let clusters = clusters::connected(&places).into_iter();
        clusters.filter_map(|cluster| change(*kind, &cluster))
    });
    let mut changes: Vec<Change> = changed.collect();
    changes.sort_by(|a, b| {
        let by_confidence = b.confidence.total_cmp(&a.confidence);
        by_confidence.then(a.x_m.total_cmp(&b.x_m))
    });
    Changes {
        compared_m2: compared as f64 * CELL_M * CELL_M,
        changed_share,
        changes,
    }
}

/// Returns the log odds of each place that is occupied in the one and free in the other, and has
/// more likely changed than not.
fn changed_places(pairs: &[Pair], noise: &Noise, changed_share: f64) -> BTreeMap<[i64; 2], Odds> {
    let prior = (changed_share / (1.0 - changed_share)).ln();
    let differing = pairs
        .iter()
        .filter(|pair| pair.own >= OCCUPIED && pair.other < FREE);
    let odds = differing.map(|pair| {
        let (log_odds, share) = (prior + noise.log_odds(pair), pair.own);
        (pair.cell, Odds { log_odds, share })
    });
    odds.filter(|(_, odds)| odds.log_odds > 0.0).collect()
}

/// Returns the change that a cluster is, if it is large enough.
fn change(kind: ChangeKind, cluster: &Cluster) -> Option<Change> {
    let outline = cluster.outline();
    let area_m2 = cluster.cells.len() as f64 * CELL_M * CELL_M;
    let is_large = outline.length_m >= MIN_LENGTH_M
        && cluster.share >= MIN_SHARE
        && cluster.share * area_m2 >= MIN_RETURNED_M2;
    is_large.then(|| Change {
        kind,
        x_m: outline.centre.x,
        y_m: outline.centre.y,
        yaw_rad: outline.yaw_rad,
        length_m: outline.length_m,
        width_m: outline.width_m,
        area_m2,
        share: cluster.share,
        confidence: 1.0 / (1.0 + (-cluster.log_odds).exp()),
    })
}
