//! A tunnel: walls without structure along a stretch of the drive. Inside a radar sees two smooth
//! lines and nothing else until a portal comes into its range: how far it drives is not determined.

use nalgebra::{Point2, Vector2};
use rand::Rng;

use crate::body::{Body, Scatterer, Wall};
use crate::error::SimulatorError;
use crate::route::{KERBS_M, Route, STEP_M};
use crate::stream::Stream;

/// Scatterers of the lining in a metre, and the cross-section of each, square metres.
const SCATTERERS_M: usize = 20;
const LINING_M2: f64 = 0.15;
/// Distance of the scatterers from the wall, metres.
const ROUGH_M: f64 = 0.02;
/// Two-way share of the power that passes a wall.
const TRANSMISSION: f64 = 1e-9;
/// The body of the walls, above all others of the scenery.
const BODY: u32 = (1 << 24) - 1;

/// Builds a tunnel that begins after a distance, with a length, metres: what stands in it goes.
pub(crate) fn build(
    [from_m, length_m]: [f64; 2],
    scenery: &mut Body,
    route: &Route,
    seed: u64,
) -> Result<(), SimulatorError> {
    let count = (length_m / STEP_M) as usize;
    let nodes = (0..=count).map(|at| route.at(from_m + at as f64 * STEP_M));
    let Some(nodes) = nodes.collect::<Option<Vec<_>>>() else {
        let value = format!("[{from_m}, {length_m}]");
        let expected = format!(
            "a tunnel that ends before the drive, which is {:.0} m long",
            route.length_m()
        );
        return Err(SimulatorError::key("tunnel_m", value, expected));
    };
    let is_inside = |place: Point2<f64>| {
        nodes.iter().any(|node| {
            let there = node.inverse_transform_point(&place);
            there.x.abs() <= STEP_M && (-KERBS_M[1]..=KERBS_M[0]).contains(&there.y)
        })
    };
    scenery.scatterers.retain(|it| !is_inside(it.position));
    scenery.walls.retain(|wall| {
        let middle = nalgebra::center(&wall.from, &wall.to);
        ![wall.from, middle, wall.to].into_iter().any(is_inside)
    });
    let rng = &mut Stream::TUNNEL.generator(seed);
    for (side, aside_m) in [1.0, -1.0].into_iter().zip(KERBS_M) {
        for piece in nodes.windows(2) {
            let [from, to] = [0, 1].map(|end| piece[end] * Point2::new(0.0, side * aside_m));
            scenery.walls.push(Wall::new(from, to, TRANSMISSION, BODY));
            let inwards = piece[0].rotation * Vector2::new(0.0, -side);
            scenery.scatterers.extend((0..SCATTERERS_M).map(|at| {
                let share = (at as f64 + rng.random_range(0.25..0.75)) / SCATTERERS_M as f64;
                let position =
                    from + (to - from) * share + inwards * rng.random_range(0.0..ROUGH_M);
                Scatterer::facing(position, LINING_M2, inwards, 1.0, BODY)
            }));
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::body::NO_BODY;
    use crate::path::SplinePath;

    fn straight() -> Route {
        let nodes = (0..40).map(|k| {
            let second = f64::from(k);
            (second, gyre_geometry::pose(5.0 * second, 0.0, 0.0))
        });
        Route::along(&SplinePath::measured(&nodes.collect::<Vec<_>>()))
    }

    #[test]
    fn what_stands_in_the_way_goes_and_the_walls_hide_the_rest() {
        let post = |x: f64, y: f64| Scatterer::all_round(Point2::new(x, y), 1.0, NO_BODY);
        let mut scenery = Body {
            scatterers: vec![post(80.0, 2.0), post(80.0, 3.5), post(20.0, 0.0)],
            walls: Vec::new(),
        };
        build([50.0, 100.0], &mut scenery, &straight(), 1).unwrap();
        let posts = scenery.scatterers.iter().filter(|it| it.body == NO_BODY);
        assert_eq!(posts.count(), 2);
        assert_eq!(scenery.walls.len(), 200);
        let sides = scenery.walls.iter().map(|wall| wall.from.y);
        let is_beside = |y: f64| (y - KERBS_M[0]).abs() < 0.1 || (y + KERBS_M[1]).abs() < 0.1;
        assert!(sides.clone().all(is_beside));
    }

    #[test]
    fn a_tunnel_beyond_the_end_of_the_drive_is_refused() {
        let refused = build([150.0, 100.0], &mut Body::default(), &straight(), 1);
        let text = refused.unwrap_err().to_string();
        assert!(
            text.contains("`tunnel_m` is [150, 100]") && text.contains("m long"),
            "{text}"
        );
    }
}
