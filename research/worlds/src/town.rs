//! A procedural town along any network of streets.
//!
//! Each side of a street is divided into stretches, and each stretch into lots by the uses of its
//! district ([`TownConfig::character`]): terraced houses, detached houses, halls, lawns, car parks,
//! fields. A second row fills what is visible through gaps. No two lots overlap, and none reaches
//! into a street. Posts, signs, trees and parked cars stand between lots and carriageway.
//!
//! The content of a place depends on the seed, the place and the streets near by alone, so a longer
//! drive or a later pass sees the same town.

mod belt;
mod boundary;
mod building;
mod changes;
mod config;
mod district;
mod facade;
mod frontage;
mod kerb;
mod land;
mod plot;
mod random;
mod site;
mod terrace;
#[cfg(test)]
mod tests;
mod vehicle;
mod works;

use nalgebra::Point2;
use rand::Rng;
use rand_chacha::ChaCha8Rng;

pub use config::{Character, TownConfig};
pub use site::ParkedCar;
pub(crate) use vehicle::car;

use crate::body::Body;
use crate::streets::Streets;
use belt::Belt;
use changes::Changes;
use district::{District, Use};
use frontage::{Frontage, Line};
use kerb::{BAYS_M, Kerb};
use land::{Lot, Register};
use plot::Plot;
use random::generator;
use site::{Built, Site};

/// Length of the stretches of a street that are divided independently of each other, metres.
const STRETCH_M: f64 = 72.0;
/// Minimum distance of lots from all kerbs, metres.
const CLEAR_M: f64 = 1.2;
/// Number of stretches after which a street repeats in a town whose streets are alike.
const ALIKE: u64 = 3;
/// Step along the street where no lot fits, metres.
const SKIP_M: f64 = 2.0;
/// Narrower remainders of a stretch stay empty, metres.
const MIN_WIDTH_M: f64 = 4.0;
/// Number of uses that are tried for a place.
const DRAWS: usize = 3;
/// Shares of the intended depth that are tried for a lot.
const DEPTHS: [f64; 3] = [1.0, 0.6, 0.35];
/// Detail of the buildings of the second row relative to the first.
const DETAIL_BEHIND: f64 = 0.5;

/// A town.
#[derive(Clone, Debug, Default)]
pub struct Town {
    /// All that stands.
    pub content: Body,
    /// The parked cars among it.
    pub parked: Vec<ParkedCar>,
}

impl Town {
    /// Builds the town along these streets; the same for the same seed.
    pub fn new(config: &TownConfig, streets: &Streets, seed: u64) -> Self {
        let Built {
            content, parked, ..
        } = Planner::plan(config, streets, seed).built;
        Self { content, parked }
    }
}

/// Builds all that stands in the town along these streets; the same for the same seed.
pub fn build(config: &TownConfig, streets: &Streets, seed: u64) -> Body {
    Town::new(config, streets, seed).content
}

#[derive(Clone, Copy, PartialEq)]
enum HouseRow {
    First,
    Second,
}

/// A part of one side of a street.
struct Stretch<'a> {
    frontage: Frontage<'a>,
    district: District,
    key: u64,
    from_m: f64,
    to_m: f64,
    /// Distance from the kerb to the lots, metres.
    pavement_m: f64,
    bays: bool,
    /// Depth of the lots, metres.
    depth_m: f64,
}

/// Builds the town.
struct Planner<'a> {
    config: &'a TownConfig,
    streets: &'a Streets,
    seed: u64,
    changes: Changes,
    register: Register,
    built: Built,
}

impl<'a> Planner<'a> {
    fn plan(config: &'a TownConfig, streets: &'a Streets, seed: u64) -> Self {
        let lines: Vec<Line> = streets.streets().iter().map(Line::new).collect();
        let mut planner = Self {
            config,
            streets,
            seed,
            changes: Changes::new(config, seed),
            register: Register::default(),
            built: Built::default(),
        };
        // First rows before second ones and driven streets before others, since the most visible
        // lots have priority.
        for row in [HouseRow::First, HouseRow::Second] {
            for driven in [true, false] {
                planner.line(&lines, row, driven);
            }
        }
        planner
    }

    /// Builds along all driven streets, or along all others.
    fn line(&mut self, lines: &[Line], row: HouseRow, driven: bool) {
        for (street, line) in lines.iter().enumerate() {
            if self.streets.streets()[street].driven != driven {
                continue;
            }
            for frontage in Frontage::sides(self.streets, street, line) {
                for number in 0..(frontage.length_m() / STRETCH_M).ceil() as u64 {
                    let stretch = self.stretch(frontage, number);
                    match self.belt(&stretch, number) {
                        Some(mut belt) if row == HouseRow::First => belt.build(&mut self.built),
                        Some(_) => {}
                        None => self.row(&stretch, row),
                    }
                    if row == HouseRow::First {
                        self.kerb(&stretch);
                    }
                }
            }
        }
    }

    fn stretch<'l>(&self, frontage: Frontage<'l>, number: u64) -> Stretch<'l> {
        let from_m = number as f64 * STRETCH_M;
        let (key, place) = if self.config.look_alike {
            let number = number % ALIKE;
            let key = random::hash(&[self.seed, frontage.side_key(), number]);
            (key, Point2::new(number as f64 * STRETCH_M, 0.0))
        } else {
            let key = random::hash(&[self.seed, frontage.key(), number]);
            (key, frontage.place(from_m + STRETCH_M / 2.0, 10.0))
        };
        let district = District::at(self.config.character, self.seed, place);
        let mut rng = generator(&[key]);
        let (bays, _) = district.kerb_shares();
        let bays = rng.random_bool(bays);
        let pavement_m = rng.random_range(1.8..3.4) + if bays { BAYS_M } else { 0.0 };
        let (min_m, max_m) = district.depth_m();
        let depth_m = rng.random_range(min_m..max_m);
        let to_m = (from_m + STRETCH_M).min(frontage.length_m());
        Stretch {
            frontage,
            district,
            key,
            from_m,
            to_m,
            pavement_m,
            bays,
            depth_m,
        }
    }

    /// The belt in the place of a stretch's lots, if there is one.
    fn belt<'l>(&self, stretch: &Stretch<'l>, number: u64) -> Option<Belt<'l>> {
        let share = self.config.belts.filter(|share| *share > 0.0)?;
        let along_m = stretch.from_m..stretch.to_m;
        Belt::draw(
            stretch.frontage,
            along_m,
            stretch.pavement_m,
            [self.seed, number],
            share,
        )
    }

    /// Divides a stretch into lots and builds on them.
    fn row(&mut self, stretch: &Stretch<'_>, row: HouseRow) {
        let mut rng = generator(&[stretch.key, 1 + row as u64]);
        let mut at_m = stretch.from_m;
        while at_m + MIN_WIDTH_M < stretch.to_m {
            let claimed = (0..DRAWS).find_map(|_| self.draw(stretch, row, at_m, &mut rng));
            if let Some((kind, lot)) = claimed {
                self.plot(
                    &lot,
                    kind,
                    stretch.key ^ row as u64,
                    row,
                    generator(&[rng.random()]),
                );
            }
            at_m += claimed.map_or(SKIP_M, |(_, lot)| lot.frontage_m);
        }
    }

    /// Draws a use and claims a lot for it, starting at `at_m`.
    fn draw(
        &mut self,
        stretch: &Stretch<'_>,
        row: HouseRow,
        at_m: f64,
        rng: &mut ChaCha8Rng,
    ) -> Option<(Use, Lot)> {
        let kind = stretch.district.draw(row == HouseRow::First, rng);
        let (min_m, max_m) = kind.width_m();
        let width_m = rng.random_range(min_m..max_m).min(stretch.to_m - at_m);
        let lot = if width_m < min_m {
            None
        } else {
            self.claim(stretch, row, kind, at_m, width_m)
        };
        lot.map(|lot| (kind, lot))
    }

    /// Claims a lot for a use, starting at `at_m`, as deep as possible.
    fn claim(
        &mut self,
        stretch: &Stretch<'_>,
        row: HouseRow,
        kind: Use,
        at_m: f64,
        width_m: f64,
    ) -> Option<Lot> {
        let out_m = stretch.pavement_m
            + if row == HouseRow::First {
                0.0
            } else {
                stretch.depth_m
            };
        let middle_m = at_m + width_m / 2.0;
        if !stretch.frontage.owns(
            middle_m,
            stretch.frontage.place(middle_m, stretch.pavement_m),
        ) {
            return None;
        }
        DEPTHS
            .iter()
            .map(|share| share * stretch.depth_m)
            .filter(|depth_m| *depth_m >= kind.min_depth_m())
            .find_map(|depth_m| {
                let lot = stretch.frontage.lot(at_m, width_m, out_m, depth_m)?;
                (lot.is_clear(self.streets, CLEAR_M) && self.register.take(&lot)).then_some(lot)
            })
    }

    fn plot(&mut self, lot: &Lot, kind: Use, row_key: u64, row: HouseRow, rng: ChaCha8Rng) {
        let (works, detail) = match row {
            HouseRow::First => (self.changes.works(&lot.pose), 1.0),
            HouseRow::Second => (None, DETAIL_BEHIND),
        };
        let is_site = works.is_some();
        let site = Site {
            built: &mut self.built,
            pose: lot.pose,
            rng: works.unwrap_or(rng),
            changes: self.changes,
        };
        let mut plot = Plot {
            site,
            config: self.config,
            width_m: lot.width_m,
            depth_m: lot.depth_m,
            row_key,
            detail,
        };
        if is_site {
            plot.building_site();
        } else {
            plot.build(kind);
        }
    }

    fn kerb(&mut self, stretch: &Stretch<'_>) {
        let Stretch {
            frontage,
            district,
            from_m,
            to_m,
            pavement_m,
            bays,
            key,
            ..
        } = *stretch;
        let rng = generator(&[key, 3]);
        Kerb {
            frontage,
            config: self.config,
            district,
            from_m,
            to_m,
            pavement_m,
            bays,
            rng,
            changes: self.changes,
        }
        .furnish(&mut self.built);
    }
}
