use nalgebra::{Point2, Vector2};

use super::*;
use crate::body::{NO_BODY, Wall};
use crate::occlusion::crossing;
use crate::streets::Street;
use crate::world::World;

/// A street from a place, with a constant curvature `turn_rad`, rad/m to the left.
fn street(
    from: (f64, f64),
    heading_rad: f64,
    length_m: f64,
    turn_rad: f64,
    driven: bool,
) -> Street {
    let mut pose = gyre_geometry::pose(from.0, from.1, heading_rad);
    let mut centre = Vec::new();
    for _ in 0..=(length_m / 2.0) as usize {
        centre.push(Point2::from(pose.translation.vector));
        pose *= gyre_geometry::pose(2.0, 0.0, 2.0 * turn_rad);
    }
    Street {
        centre,
        half_width_m: if driven { 4.0 } else { 2.5 },
        driven,
    }
}

/// A driven street with bends in both directions, and others that branch off at various angles or
/// cross it.
fn network() -> Streets {
    let mut bends = street((0.0, 0.0), 0.0, 200.0, 0.0, true);
    let last = bends.centre[bends.centre.len() - 1];
    bends.centre.extend(
        street((last.x, last.y), 0.0, 60.0, 0.035, true)
            .centre
            .into_iter()
            .skip(1),
    );
    let last = bends.centre[bends.centre.len() - 1];
    bends.centre.extend(
        street((last.x, last.y), 2.1, 120.0, -0.02, true)
            .centre
            .into_iter()
            .skip(1),
    );
    let side = |x: f64, heading_rad: f64, turn_rad: f64| {
        street((x, 0.0), heading_rad, 150.0, turn_rad, false)
    };
    Streets::new(vec![
        bends,
        side(40.0, 0.6, 0.0),
        side(40.0, 2.6, 0.004),
        side(90.0, 1.57, 0.01),
        side(90.0, -1.2, -0.01),
        side(160.0, -2.5, 0.0),
        street((-20.0, 30.0), -0.9, 130.0, 0.0, false),
    ])
}

fn config(character: Character) -> TownConfig {
    TownConfig {
        character,
        ..TownConfig::default()
    }
}

const CHARACTERS: [Character; 5] = [
    Character::Mixed,
    Character::City,
    Character::Suburb,
    Character::Campus,
    Character::Country,
];

#[test]
fn carriageways_are_free_in_bends_and_at_junctions_of_any_angle() {
    let streets = network();
    for (seed, character) in (0..15).zip(CHARACTERS.into_iter().cycle()) {
        let town = build(&config(character), &streets, seed);
        for scatterer in &town.scatterers {
            let clearance_m = streets.clearance_m(scatterer.position, 1.0);
            assert!(
                clearance_m > 0.0,
                "seed {seed}, {character:?}: {clearance_m} m at {scatterer:?}"
            );
        }
        for wall in &town.walls {
            let steps = ((wall.to - wall.from).norm() / 0.5).ceil();
            for step in 0..=steps as usize {
                let place = wall.from + (wall.to - wall.from) * (step as f64 / steps);
                assert!(
                    streets.clearance_m(place, 1.0) > 0.0,
                    "seed {seed}, {character:?}: a wall at {place}"
                );
            }
        }
    }
}

#[test]
fn every_straight_street_is_free_from_end_to_end() {
    let streets = network();
    let world = World::new(build(&config(Character::City), &streets, 3));
    for (street, length_m) in [(0, 200.0), (1, 148.0), (5, 148.0), (6, 128.0)] {
        let end =
            |along_m: f64| Point2::from(streets.streets()[street].at(along_m).translation.vector);
        assert_eq!(
            world.transmission(end(0.0), end(length_m), NO_BODY, 0.0),
            1.0,
            "street {street}"
        );
    }
}

#[test]
fn buildings_do_not_overlap() {
    let streets = network();
    for (seed, character) in (0..5).zip(CHARACTERS) {
        let town = build(&config(character), &streets, seed);
        let solid: Vec<&Wall> = town
            .walls
            .iter()
            .filter(|wall| wall.transmission < 0.2)
            .collect();
        assert!(solid.len() > 20, "{character:?}: {}", solid.len());
        for (index, wall) in solid.iter().enumerate() {
            // Neighbours may share a wall or a corner, but a building shrunk by some centimetres
            // must not touch the other.
            let inset = (wall.to - wall.from).normalize() * 0.05;
            for other in solid[index + 1..]
                .iter()
                .filter(|other| other.body != wall.body)
            {
                let direction = wall.to - wall.from - 2.0 * inset;
                let shorter = (other.to - other.from).normalize() * 0.05;
                let other = Wall {
                    from: other.from + shorter,
                    to: other.to - shorter,
                    ..**other
                };
                let across = direction.perp(&(other.to - other.from)).abs() > 1e-3;
                let crossed = across && crossing(wall.from + inset, direction, &other).is_some();
                assert!(
                    !crossed,
                    "seed {seed}, {character:?}: {wall:?} and {other:?}"
                );
            }
        }
    }
}

#[test]
fn land_is_taken_once() {
    let streets = network();
    let config = config(Character::Mixed);
    let planner = Planner::plan(&config, &streets, 5);
    let lots = planner.register.lots();
    assert!(lots.len() > 50, "{}", lots.len());
    for (index, lot) in lots.iter().enumerate() {
        assert!(lot.is_clear(&streets, CLEAR_M));
        assert!(!lots[index + 1..].iter().any(|other| lot.overlaps(other)));
    }
}

#[test]
fn same_seed_builds_the_same_town_and_another_seed_another() {
    let streets = network();
    let town = |seed| build(&TownConfig::default(), &streets, seed);
    assert_eq!(town(3).scatterers, town(3).scatterers);
    assert_eq!(town(3).walls, town(3).walls);
    assert_ne!(town(3).scatterers, town(4).scatterers);
}

#[test]
fn a_place_looks_the_same_when_its_street_becomes_longer() {
    let place = |town: &Body| -> Vec<(Point2<f64>, f64)> {
        let here = town.scatterers.iter().filter(|s| s.position.x < 350.0);
        here.map(|s| (s.position, s.cross_section_m2)).collect()
    };
    let side = street((200.0, 0.0), 1.3, 200.0, 0.0, false);
    let town = |length_m: f64, farther: Option<Street>| {
        let mut streets = vec![street((0.0, 0.0), 0.0, length_m, 0.0, true)];
        // The longer street begins farther on, but comes before the others.
        streets.extend(farther);
        streets.push(side.clone());
        place(&build(&TownConfig::default(), &Streets::new(streets), 9))
    };
    let short = town(500.0, None);
    assert!(short.len() > 1000, "{}", short.len());
    let long = town(900.0, Some(street((700.0, 0.0), 1.0, 100.0, 0.0, false)));
    assert!(
        short == long,
        "{} and {} scatterers",
        short.len(),
        long.len()
    );
}

#[test]
fn a_street_that_is_driven_twice_is_built_once() {
    let once = street((0.0, 0.0), 0.0, 600.0, 0.0, true);
    let mut twice = once.clone();
    twice
        .centre
        .extend(street((600.0, 1.5), std::f64::consts::PI, 600.0, 0.0, true).centre);
    let count = |street: Street| {
        build(&TownConfig::default(), &Streets::new(vec![street]), 2)
            .scatterers
            .len() as f64
    };
    let ratio = count(twice) / count(once);
    assert!((0.7..1.3).contains(&ratio), "{ratio}");
}

#[test]
fn a_town_is_as_dense_as_its_character() {
    let streets = network();
    let count = |character| {
        let town = build(&config(character), &streets, 1);
        let near = |place: Point2<f64>| (place - Point2::new(90.0, 0.0)).norm() < 165.0;
        (
            town.scatterers.iter().filter(|s| near(s.position)).count(),
            town.walls.len(),
        )
    };
    let [_, city, suburb, campus, country] = CHARACTERS.map(count);
    assert!((25_000..70_000).contains(&city.0), "{city:?}");
    assert!(
        city.0 > suburb.0 && suburb.0 > campus.0 && campus.0 > country.0,
        "{suburb:?} {campus:?} {country:?}"
    );
    assert!(country.0 > 2_000 && country.1 < city.1 / 2, "{country:?}");
}

#[test]
fn streets_without_length_and_no_streets_give_a_town_too() {
    let point = Street {
        centre: vec![Point2::origin(); 2],
        half_width_m: 3.0,
        driven: true,
    };
    assert!(
        build(&TownConfig::default(), &Streets::new(vec![point]), 1)
            .scatterers
            .is_empty()
    );
    assert!(
        build(&TownConfig::default(), &Streets::default(), 1)
            .scatterers
            .is_empty()
    );
}

#[test]
fn look_alike_streets_have_the_same_facades() {
    let streets = Streets::new(vec![
        street((0.0, 0.0), 0.0, 500.0, 0.0, true),
        street((300.0, 900.0), 1.0, 500.0, 0.0, true),
    ]);
    let alike = TownConfig {
        look_alike: true,
        ..TownConfig::default()
    };
    let solid = |config: &TownConfig, of: usize| -> Vec<[Point2<f64>; 2]> {
        let start = streets.streets()[of].at(0.0).inverse();
        let walls = build(config, &streets, 4).walls;
        let ends = walls
            .iter()
            .filter(|wall| wall.transmission < 0.2)
            .map(|wall| [start * wall.from, start * wall.to]);
        ends.filter(|ends| ends[0].x.abs() < 600.0 && ends[0].y.abs() < 100.0)
            .collect()
    };
    let same = |a: &[Point2<f64>; 2], b: &[Point2<f64>; 2]| {
        (a[0] - b[0]).norm() < 1e-6 && (a[1] - b[1]).norm() < 1e-6
    };
    let share = |config: &TownConfig, ahead_m: f64| {
        let (one, other) = (solid(config, 0), solid(config, 1));
        let reached = |wall: &&[Point2<f64>; 2]| (5.0..140.0).contains(&wall[0].x);
        let ahead = Vector2::new(ahead_m, 0.0);
        let here: Vec<_> = one.iter().filter(reached).collect();
        let found = |wall: &&&[Point2<f64>; 2]| {
            other
                .iter()
                .any(|there| same(&[wall[0] + ahead, wall[1] + ahead], there))
        };
        assert!(here.len() > 20, "{}", here.len());
        here.iter().filter(found).count() as f64 / here.len() as f64
    };
    assert_eq!(share(&alike, 0.0), 1.0, "two streets");
    let repeated = share(&alike, 3.0 * STRETCH_M);
    assert!(repeated > 0.95, "{repeated} along one street");
    assert_eq!(share(&TownConfig::default(), 0.0), 0.0);
}
