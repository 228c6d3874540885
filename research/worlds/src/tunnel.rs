//! Tunnels: walls without structure along a stretch of the drive, one of the sections
//! `[[simulation.tunnels]]`.
//!
//! Inside one a radar sees two smooth lines and nothing else, until a portal comes into its range:
//! how far the vehicle drives is not determined. The cross-section is that of a road with two lanes
//! (RABT, RQ 10.5 T: a carriageway of 7.5 m between walkways of 1 m). The lining is rough to the
//! radar and everywhere the same: its echoes are speckle, which is new at every place of the
//! vehicle. Niches, lamps and fans are left out, since they would tell the way. The roof, which the
//! beam of a level radar meets far away, is neglected.

use nalgebra::{Point2, Vector2};
use rand::Rng;
use serde::{Deserialize, Serialize};

use crate::body::{Aspect, Body, Scatterer, Wall};
use crate::error::SimulatorError;
use crate::lanes::DrivingSide;
use crate::limits::require_within;
use crate::path::Path;
use crate::stream::Stream;

/// Distance from the vehicle's path to the wall of its own lane and to that of the other, metres.
const NEAR_M: f64 = 3.0;
const FAR_M: f64 = 6.5;
/// Length of a piece of the walls, which follow the path, metres.
const PIECE_M: f64 = 2.0;
/// Scatterers of the lining, in a metre, and the cross-section of each, square metres: a third
/// less than that of a wall of rubble stone. Both are assumed.
const SCATTERERS_M: usize = 20;
const LINING_M2: f64 = 0.15;
/// Deviation from even distances, as a share of those; and distance from the wall, metres.
const UNEVEN: f64 = 0.5;
const ROUGH_M: f64 = 0.02;
/// Two-way share of the power that passes a wall, and the share that is mirrored: concrete.
const TRANSMISSION: f64 = 1e-9;
const MIRROR: f64 = 0.1;
/// Time between the places of the path by which its length is measured, seconds.
const STEP_S: f64 = 0.05;
/// A drive that has no end is measured so far, seconds.
const ENDLESS_S: f64 = 36_000.0;

/// A tunnel over a stretch of the drive.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct TunnelConfig {
    /// Way that the vehicle has driven where it begins, metres.
    pub from_m: f64,
    /// Length, metres.
    pub length_m: f64,
}

impl TunnelConfig {
    /// Checks that all values can be simulated.
    ///
    /// # Errors
    /// [`SimulatorError::Config`] with the key of the first value that cannot.
    pub fn validate(&self) -> Result<(), SimulatorError> {
        require_within("tunnels.from_m", self.from_m, 0.0, 1e5)?;
        require_within("tunnels.length_m", self.length_m, 10.0, 1e4)
    }
}

/// Builds the tunnels of a drive into a town: what stands in them goes.
///
/// # Errors
/// [`SimulatorError::Config`] if the drive ends before a tunnel does.
pub(crate) fn build(
    tunnels: &[TunnelConfig],
    town: &mut Body,
    path: &dyn Path,
    keep: DrivingSide,
    seed: u64,
) -> Result<(), SimulatorError> {
    for (number, tunnel) in (0..).zip(tunnels) {
        let tube = Tube::along(path, tunnel, keep)?;
        tube.clear(town);
        let bodies = town.walls.iter().map(|wall| wall.body);
        let bodies = bodies.chain(town.scatterers.iter().map(|it| it.body));
        let body = bodies.max().unwrap_or_default() + 1;
        tube.line(town, body, &mut Stream::Tunnel(number).generator(seed));
    }
    Ok(())
}

/// The space between the walls.
struct Tube {
    /// Places of the path, [`PIECE_M`] apart, with the unit vector to the left.
    nodes: Vec<(Point2<f64>, Vector2<f64>)>,
    /// Distance of the walls to the left and to the right.
    aside_m: [f64; 2],
}

impl Tube {
    fn along(
        path: &dyn Path,
        tunnel: &TunnelConfig,
        keep: DrivingSide,
    ) -> Result<Self, SimulatorError> {
        let until_m = tunnel.from_m + tunnel.length_m;
        let (places, driven_m) = places(path, [tunnel.from_m, until_m]);
        if driven_m < until_m {
            return Err(SimulatorError::Config {
                key: "tunnels.from_m",
                value: tunnel.from_m.to_string(),
                expected: format!(
                    "such that the tunnel of {} m ends before the drive, which is {driven_m:.0} m long",
                    tunnel.length_m
                ),
            });
        }
        let left = |at: usize| {
            let ends = [at.saturating_sub(1), (at + 1).min(places.len() - 1)];
            let along = places[ends[1]] - places[ends[0]];
            let along = along.try_normalize(1e-6).unwrap_or_else(Vector2::x);
            Vector2::new(-along.y, along.x)
        };
        Ok(Self {
            nodes: (0..places.len()).map(|at| (places[at], left(at))).collect(),
            aside_m: match keep {
                DrivingSide::Left => [NEAR_M, FAR_M],
                DrivingSide::Right => [FAR_M, NEAR_M],
            },
        })
    }

    /// Removes what stands between the walls.
    fn clear(&self, town: &mut Body) {
        let places = || self.nodes.iter().map(|(place, _)| *place);
        let start = self.nodes[0].0;
        let low = places().fold(start, |a, b| a.inf(&b)) - Vector2::repeat(FAR_M);
        let high = places().fold(start, |a, b| a.sup(&b)) + Vector2::repeat(FAR_M);
        let is_inside = |place: Point2<f64>| {
            let is_near = low <= place && place <= high;
            is_near && self.nodes.windows(2).any(|piece| self.holds(piece, place))
        };
        town.scatterers.retain(|it| !is_inside(it.position));
        town.walls.retain(|wall| {
            let middle = nalgebra::center(&wall.from, &wall.to);
            ![wall.from, middle, wall.to].into_iter().any(is_inside)
        });
    }

    /// Returns whether a place is between the walls beside a piece of the path.
    fn holds(&self, piece: &[(Point2<f64>, Vector2<f64>)], place: Point2<f64>) -> bool {
        let (along, from) = (piece[1].0 - piece[0].0, place - piece[0].0);
        let share = from.dot(&along) / along.norm_squared().max(1e-12);
        let aside_m = from.dot(&piece[0].1);
        (-0.25..=1.25).contains(&share) && (-self.aside_m[1]..=self.aside_m[0]).contains(&aside_m)
    }

    /// Builds both walls with their lining, as one body.
    fn line(&self, town: &mut Body, body: u32, rng: &mut impl Rng) {
        for (side, aside_m) in [1.0, -1.0].into_iter().zip(self.aside_m) {
            for piece in self.nodes.windows(2) {
                let [from, to] = [0, 1].map(|end| piece[end].0 + piece[end].1 * (side * aside_m));
                town.walls.push(Wall {
                    mirror: MIRROR,
                    ..Wall::rough(from, to, TRANSMISSION, body)
                });
                let inwards = piece[0].1 * -side;
                let count = (SCATTERERS_M as f64 * PIECE_M) as usize;
                let lining = (0..count).map(|at| {
                    let uneven = UNEVEN * rng.random_range(-0.5..0.5);
                    let share = (at as f64 + 0.5 + uneven) / count as f64;
                    let position =
                        from + (to - from) * share + inwards * rng.random_range(0.0..ROUGH_M);
                    Scatterer {
                        position,
                        cross_section_m2: LINING_M2,
                        aspect: Aspect::Facing {
                            normal: inwards,
                            sharpness: 1.0,
                        },
                        body,
                    }
                });
                town.scatterers.extend(lining);
            }
        }
    }
}

/// The places of a path, [`PIECE_M`] apart, from one way that is driven to another, metres; and the
/// way that is driven at the last of them.
fn places(path: &dyn Path, [from_m, until_m]: [f64; 2]) -> (Vec<Point2<f64>>, f64) {
    let at = |step: usize| Point2::from(path.pose(step as f64 * STEP_S).translation.vector);
    let steps = (path.duration_s().min(ENDLESS_S) / STEP_S) as usize;
    let (mut places, mut driven_m, mut before) = (Vec::new(), 0.0, at(0));
    for step in 1..=steps {
        let next = at(step);
        let step_m = (next - before).norm();
        // All nodes within the step.
        loop {
            let wanted_m = from_m + places.len() as f64 * PIECE_M;
            if wanted_m > driven_m + step_m || wanted_m > until_m || step_m == 0.0 {
                break;
            }
            places.push(before + (next - before) * ((wanted_m - driven_m) / step_m));
        }
        driven_m += step_m;
        before = next;
        if driven_m >= until_m {
            break;
        }
    }
    (places, driven_m)
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use gyre_geometry::Twist;

    use super::*;
    use crate::body::NO_BODY;

    /// A bend to the left at 10 m/s.
    const BEND: Twist = Twist {
        vx_mps: 10.0,
        vy_mps: 0.0,
        yaw_rate_radps: 0.02,
    };
    const TUNNEL: TunnelConfig = TunnelConfig {
        from_m: 50.0,
        length_m: 300.0,
    };

    #[test]
    fn the_walls_follow_the_path_and_hide_all_that_is_outside() {
        let mut town = Body::default();
        build(&[TUNNEL], &mut town, &BEND, DrivingSide::Left, 1).unwrap();
        assert_eq!(town.walls.len(), 2 * 150);
        let length_m = |walls: &[Wall]| {
            let lengths = walls.iter().map(|wall| (wall.to - wall.from).norm());
            lengths.sum::<f64>()
        };
        // The radius is 500 m.
        let [left, right] = [&town.walls[..150], &town.walls[150..]].map(length_m);
        assert!((left - 300.0 * 497.0 / 500.0).abs() < 0.2, "{left}");
        assert!((right - 300.0 * 506.5 / 500.0).abs() < 0.2, "{right}");
        for scatterer in &town.scatterers {
            let turned = (scatterer.position - Point2::new(0.0, 500.0)).norm();
            let aside_m = 500.0 - turned;
            let is_on_wall = (aside_m - NEAR_M).abs() < 0.05 || (aside_m + FAR_M).abs() < 0.05;
            assert!(is_on_wall, "{aside_m} m to the left");
            let direction = Vector2::new(0.0, 500.0) - scatterer.position.coords;
            let side = (NEAR_M - aside_m).abs() < 0.05;
            let facing = scatterer.aspect.gain(direction.normalize());
            assert_eq!(facing > 0.9, !side, "it faces the road");
        }
    }

    #[test]
    fn what_stands_in_the_way_goes_and_the_rest_stays() {
        let at = |time_s: f64, aside_m: f64| {
            let pose = BEND.pose_at(time_s);
            pose * Point2::new(0.0, aside_m)
        };
        let post = |place| Scatterer::all_round(place, 1.0, NO_BODY);
        let kept = [at(3.0, 0.0), at(20.0, 3.4), at(20.0, -7.0), at(36.0, 0.0)];
        let gone = [at(6.0, 2.5), at(20.0, 0.0), at(34.0, -6.0)];
        let mut town = Body::of(kept.into_iter().chain(gone).map(post).collect());
        town.walls.push(Wall::rough(gone[1], kept[1], 0.1, 7));
        build(&[TUNNEL], &mut town, &BEND, DrivingSide::Left, 1).unwrap();
        let posts = town.scatterers.iter().filter(|it| it.body == NO_BODY);
        let places: Vec<_> = posts.map(|it| it.position).collect();
        assert_eq!(places, kept);
        assert!(
            town.walls.iter().all(|wall| wall.body == 1),
            "one body, and the wall is gone"
        );
    }

    #[test]
    fn a_tunnel_beyond_the_end_of_the_drive_is_refused() {
        let nodes = (0..40).map(|k| {
            (
                f64::from(k),
                gyre_geometry::pose(5.0 * f64::from(k), 0.0, 0.0),
            )
        });
        let path = crate::path::SplinePath::new(&nodes.collect::<Vec<_>>(), 0.7);
        let error = build(&[TUNNEL], &mut Body::default(), &path, DrivingSide::Left, 1);
        let text = error.unwrap_err().to_string();
        assert!(
            text.contains("`tunnels.from_m` is 50") && text.contains("195 m long"),
            "{text}"
        );
    }
}
