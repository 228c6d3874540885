//! A procedural town: blocks of houses on a grid of streets around the vehicle's loop.
//!
//! The streets of the loop run on through the town, so that the radar looks along them as far as it reaches. Each
//! block's edge is lined with houses (with gaps and fences between), each kerb with lamp posts, trees and parked cars.

mod building;
mod random;
mod street;

use nalgebra::{Point2, Vector2};
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;

pub(crate) use street::car;

use crate::drive::DriveConfig;
use crate::streets::Streets;
use crate::world::{Body, NO_BODY};

/// From a street's centre to the fronts of its houses, metres.
const HALF_STREET_M: f64 = 9.0;
/// How far beyond the loop the town goes on, metres: as far as the radar reaches.
const OUTSKIRTS_M: f64 = 165.0;
/// Between a parked car or post and the path, metres.
const CLEARANCE_M: f64 = 3.0;
/// The town's stream of random numbers; scans use the ones after it.
const TOWN_STREAM: u64 = 0;

/// An edge of a block: a line of house fronts with the street on its right-hand side.
#[derive(Clone, Copy, Debug)]
struct Edge {
    start: Point2<f64>,
    /// Unit vector along the edge.
    along: Vector2<f64>,
    length_m: f64,
    /// From here to the middle of the block, metres: no house is deeper.
    half_block_m: f64,
}

impl Edge {
    /// Unit vector towards the street.
    fn outward(&self) -> Vector2<f64> {
        Vector2::new(self.along.y, -self.along.x)
    }

    /// A point `along` metres down the edge and `out` metres into the street.
    fn at(&self, along: f64, out: f64) -> Point2<f64> {
        self.start + self.along * along + self.outward() * out
    }
}

/// Puts the town together.
struct Planner<'a> {
    streets: &'a Streets,
    rng: ChaCha8Rng,
    content: Body,
    last_body: u32,
}

/// The town around a loop; the same for the same seed.
pub fn build(config: &DriveConfig, streets: &Streets, seed: u64) -> Body {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    rng.set_stream(TOWN_STREAM);
    let columns = street_lines(config.block_length_m / 2.0, &mut rng);
    let rows = street_lines(config.block_width_m / 2.0, &mut rng);
    let mut planner = Planner { streets, rng, content: Body::default(), last_body: NO_BODY };
    for x in columns.windows(2) {
        for y in rows.windows(2) {
            planner.block([x[0], x[1]], [y[0], y[1]]);
        }
    }
    planner.content
}

/// Centre lines of parallel streets, ascending: the loop's two at `-half` and `half`, and more to both sides.
fn street_lines(half: f64, rng: &mut ChaCha8Rng) -> Vec<f64> {
    let mut lines = vec![-half, half];
    let end = half + OUTSKIRTS_M;
    while lines[lines.len() - 1] < end {
        lines.push(lines[lines.len() - 1] + rng.random_range(50.0..85.0));
    }
    while lines[0] > -end {
        lines.insert(0, lines[0] - rng.random_range(50.0..85.0));
    }
    lines
}

impl Planner<'_> {
    fn next_body(&mut self) -> u32 {
        self.last_body += 1;
        self.last_body
    }

    /// Lines the four edges of the block between four streets, given by their centre lines.
    fn block(&mut self, x: [f64; 2], y: [f64; 2]) {
        let (x, y) = (inset(x), inset(y));
        let (length, width) = (x[1] - x[0], y[1] - y[0]);
        let edge = |corner: (f64, f64), along: (f64, f64), length_m: f64, depth: f64| Edge {
            start: Point2::new(corner.0, corner.1),
            along: Vector2::new(along.0, along.1),
            length_m,
            half_block_m: depth / 2.0,
        };
        let edges = [
            edge((x[0], y[0]), (1.0, 0.0), length, width),
            edge((x[1], y[0]), (0.0, 1.0), width, length),
            edge((x[1], y[1]), (-1.0, 0.0), length, width),
            edge((x[0], y[1]), (0.0, -1.0), width, length),
        ];
        for (index, edge) in edges.iter().enumerate() {
            // The long rows of houses turn the corners; the others begin behind them.
            self.row_of_houses(edge, index % 2 == 0);
            self.kerb(edge);
        }
    }
}

fn inset(span: [f64; 2]) -> [f64; 2] {
    [span[0] + HALF_STREET_M, span[1] - HALF_STREET_M]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::trajectory::{BlockLoop, Trajectory};
    use crate::world::World;

    fn town(seed: u64) -> (BlockLoop, Streets, World) {
        let config = DriveConfig::default();
        let path = BlockLoop::new(config.block_length_m, config.block_width_m, config.speed_m_s, 5.0);
        let streets = Streets::driven(&path, path.lap_s(), 1.0);
        let world = World::new(build(&config, &streets, seed));
        (path, streets, world)
    }

    #[test]
    fn same_seed_builds_the_same_town_and_another_seed_another() {
        assert_eq!(town(3).2.scatterers(), town(3).2.scatterers());
        assert_ne!(town(3).2.scatterers(), town(4).2.scatterers());
    }

    #[test]
    fn road_is_free_along_the_whole_loop() {
        for seed in 0..5 {
            let (path, streets, world) = town(seed);
            let nearest =
                world.scatterers().iter().map(|s| streets.clearance_m(s.position, 9.0)).fold(f64::INFINITY, f64::min);
            assert!(nearest > 0.2, "seed {seed}: something stands {nearest} m beside the road");
            for i in 0..200 {
                let way = |time: f64| Point2::from(path.pose(time).translation.vector);
                let (from, to) = (way(f64::from(i) * 0.1), way(f64::from(i) * 0.1 + 0.1));
                assert_eq!(world.transmission(from, to, NO_BODY, 0.0), 1.0, "seed {seed}: a wall across the road");
            }
        }
    }

    #[test]
    fn town_is_as_dense_as_a_town() {
        let world = town(1).2;
        assert!((20_000..200_000).contains(&world.scatterers().len()), "{}", world.scatterers().len());
        assert!((1_000..20_000).contains(&world.walls().len()), "{}", world.walls().len());
    }
}
