//! The changes from one drive to another while the town stays.

use gyre_geometry::Pose;
use nalgebra::Point2;
use rand::Rng;
use rand_chacha::ChaCha8Rng;

use super::config::TownConfig;
use super::random::generator;

/// Marks the generators of building sites.
const WORKS: u64 = 1;
/// Marks the generators of cars and leaves.
const REST: u64 = 2;

/// The changes from one drive to another while the town stays.
#[derive(Clone, Copy)]
pub(super) struct Changes {
    town_seed: u64,
    seed: Option<u64>,
    /// Share of the leaves, 0 to 1.
    pub leaves: f64,
    building_sites: f64,
}

impl Changes {
    pub(super) fn new(config: &TownConfig, town_seed: u64) -> Self {
        Self {
            town_seed,
            seed: config.changes_seed,
            leaves: config.leaves,
            building_sites: config.building_sites,
        }
    }

    /// The generator of what stands at a place and changes; `None` where all is as the town's seed
    /// has it.
    pub(super) fn generator(&self, place: Point2<f64>) -> Option<ChaCha8Rng> {
        Some(at(&[self.seed?, REST], place))
    }

    /// The generator of the building site on a lot; `None` if there is none.
    pub(super) fn works(&self, lot: &Pose) -> Option<ChaCha8Rng> {
        let place = Point2::from(lot.translation.vector);
        let mut rng = at(&[self.seed.unwrap_or(self.town_seed), WORKS], place);
        rng.random_bool(self.building_sites).then_some(rng)
    }
}

fn at(keys: &[u64; 2], place: Point2<f64>) -> ChaCha8Rng {
    generator(&[keys[0], keys[1], place.x.to_bits(), place.y.to_bits()])
}
