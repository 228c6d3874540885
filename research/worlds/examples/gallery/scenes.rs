//! Synthetic scenes, each suited to one effect. The sensor is at the origin, x ahead and y to the
//! left.

use std::f64::consts::TAU;
use std::ops::Range;

use gyre_geometry::Pose;
use gyre_worlds::body::{Aspect, NO_BODY, Scatterer, Wall};
use gyre_worlds::{Body, Movers, Moving};
use nalgebra::{Point2, Vector2};
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// A scatterer that reflects in all directions.
pub fn post(x: f64, y: f64, cross_section_m2: f64) -> Scatterer {
    Scatterer::all_round(Point2::new(x, y), cross_section_m2, NO_BODY)
}

/// Posts at ranges and azimuths (clockwise from ahead, radians).
pub fn posts_at(places: impl IntoIterator<Item = (f64, f64)>, cross_section_m2: f64) -> Body {
    let posts = places.into_iter().map(|(range_m, azimuth_rad)| {
        post(
            range_m * azimuth_rad.cos(),
            -range_m * azimuth_rad.sin(),
            cross_section_m2,
        )
    });
    Body::of(posts.collect())
}

/// A square lattice of posts around the sensor.
pub fn lattice(spacing_m: f64, half_m: f64, cross_section_m2: f64) -> Body {
    let steps = (half_m / spacing_m) as i32;
    let places =
        (-steps..=steps).flat_map(|i| (-steps..=steps).map(move |j| (f64::from(i), f64::from(j))));
    let posts = places
        .filter(|place| *place != (0.0, 0.0))
        .map(|(i, j)| post(i * spacing_m, j * spacing_m, cross_section_m2));
    Body::of(posts.collect())
}

/// A rough wall between two points, with many scatterers in each resolution cell.
pub fn rough_wall(from: (f64, f64), to: (f64, f64), m2_per_m: f64) -> Body {
    let (from, to) = (Point2::new(from.0, from.1), Point2::new(to.0, to.1));
    let count = ((to - from).norm() / 0.07) as usize;
    let place = |i: usize| from + (to - from) * (i as f64 / count as f64);
    let cross_section_m2 = m2_per_m * (to - from).norm() / count as f64;
    let scatterers = (0..count)
        .map(|i| post(place(i).x, place(i).y, cross_section_m2))
        .collect();
    Body::of(scatterers)
}

/// The four sides of a courtyard around the sensor.
pub fn courtyard(half_m: f64) -> Body {
    let corners = [
        (half_m, half_m),
        (half_m, -half_m),
        (-half_m, -half_m),
        (-half_m, half_m),
    ];
    let mut all = Body::default();
    (0..4).for_each(|i| all.extend(rough_wall(corners[i], corners[(i + 1) % 4], 3.0)));
    all
}

/// Scatterers evenly around the sensor, at a range.
pub fn ring(range_m: f64, count: usize, cross_section_m2: f64) -> Body {
    posts_at(
        (0..count).map(|i| (range_m, TAU * (i as f64 + 0.5) / count as f64)),
        cross_section_m2,
    )
}

/// Scatterers at random around the sensor, between two ranges.
pub fn scattered(range_m: Range<f64>, count: usize, cross_section_m2: f64) -> Body {
    let mut rng = ChaCha8Rng::seed_from_u64(1);
    let places = (0..count).map(|_| {
        (
            rng.random_range(range_m.clone()),
            rng.random_range(0.0..TAU),
        )
    });
    posts_at(places, cross_section_m2)
}

/// A wall of smooth panels along the left side.
pub fn panels(y: f64, sharpness: f64) -> Body {
    let mut wall = rough_wall((-40.0, y), (40.0, y), 8.0);
    let aspect = Aspect::Facing {
        normal: Vector2::new(0.0, -1.0),
        sharpness,
    };
    wall.scatterers
        .iter_mut()
        .for_each(|scatterer| scatterer.aspect = aspect);
    wall
}

/// A wall that hides or mirrors.
pub fn wall(from: (f64, f64), to: (f64, f64), transmission: f64, mirror: f64) -> Wall {
    Wall {
        from: Point2::new(from.0, from.1),
        to: Point2::new(to.0, to.1),
        transmission,
        mirror,
        body: 1,
    }
}

/// A sheet of metal to the left, with three posts in front of it.
pub fn metal_wall() -> Body {
    let mut all = rough_wall((-22.0, 14.0), (22.0, 14.0), 0.05);
    all.walls
        .push(wall((-22.0, 14.0), (22.0, 14.0), 0.001, 0.9));
    all.scatterers.extend([
        post(9.0, 6.0, 60.0),
        post(-3.0, 8.0, 60.0),
        post(-11.0, 5.0, 60.0),
    ]);
    all
}

/// A long faint glass front to the left, with three posts in front of it.
pub fn glass_front() -> Body {
    let mut all = rough_wall((-60.0, 14.0), (60.0, 14.0), 0.005);
    all.walls.push(wall((-60.0, 14.0), (60.0, 14.0), 0.1, 0.4));
    all.scatterers.extend([
        post(21.0, 9.0, 5.0),
        post(7.0, 9.0, 5.0),
        post(-9.0, 9.0, 5.0),
    ]);
    all
}

/// The fronts of two houses among posts.
pub fn walls_among_posts() -> Body {
    let mut all = lattice(5.0, 45.0, 5.0);
    for (from, to) in [((12.0, 3.0), (12.0, -9.0)), ((-6.0, 13.0), (9.0, 17.0))] {
        all.extend(rough_wall(from, to, 4.0));
        all.walls.push(wall(from, to, 1e-4, 0.0));
    }
    all
}

/// A car that passes the sensor at a constant speed along x.
pub struct Passing {
    pub car: Body,
    pub speed_mps: f64,
}

impl Passing {
    /// The outline of a car, 4.4 m by 1.8 m.
    pub fn new(speed_mps: f64) -> Self {
        let along = (0..12).map(|i| -2.2 + 0.4 * f64::from(i));
        let scatterers = along
            .flat_map(|x| [post(x, 0.9, 1.0), post(x, -0.9, 1.0)])
            .collect();
        Self {
            car: Body::of(scatterers),
            speed_mps,
        }
    }
}

impl Movers for Passing {
    fn visit<'a>(&'a self, time_s: f64, _: Point2<f64>, _: f64, see: &mut dyn FnMut(Moving<'a>)) {
        let velocity = Vector2::new(self.speed_mps, 0.0);
        let pose = Pose::translation(self.speed_mps * time_s - 10.0, -4.0);
        see(Moving {
            body: &self.car,
            pose,
            velocity,
        });
    }
}
