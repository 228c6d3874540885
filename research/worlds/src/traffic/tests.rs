#![allow(clippy::unwrap_used)]
use std::collections::BTreeMap;

use gyre_geometry::Pose;
use nalgebra::Vector2;

use super::track::Track;
use super::*;
use crate::path::{BlockLoop, TownDrive};

fn town(seed: u64, config: &TrafficConfig) -> (Arc<dyn Path>, Traffic) {
    let town = TownDrive {
        length_m: 2500.0,
        speed_mps: 13.9,
        lateral_acceleration_mps2: 2.2,
        driving_side: DrivingSide::Left,
    };
    let drive: Arc<dyn Path> = Arc::new(town.path(seed));
    let duration_s = drive.duration_s();
    let streets = Streets::along(drive.as_ref(), duration_s, DrivingSide::Left, seed);
    let traffic = Traffic::new(
        config,
        drive.clone(),
        duration_s,
        &streets,
        DrivingSide::Left,
        seed,
    );
    (drive, traffic)
}

fn around(
    traffic: &Traffic,
    drive: &dyn Path,
    time_s: f64,
    reach_m: f64,
) -> Vec<(u32, Pose, Vector2<f64>)> {
    let mut all = Vec::new();
    let centre = Point2::from(drive.pose(time_s).translation.vector);
    traffic.visit(time_s, centre, reach_m, &mut |m| {
        all.push((m.body.scatterers[0].body, m.pose, m.velocity))
    });
    all
}

/// Returns whether two road users overlap.
fn overlap(a: &Actor, at: &Pose, b: &Actor, there: &Pose) -> bool {
    let seen = at.inverse() * there;
    let (cosine, sine) = (
        seen.rotation.cos_angle().abs(),
        seen.rotation.sin_angle().abs(),
    );
    let length_m = a.half_m.0 + b.half_m.0 * cosine + b.half_m.1 * sine;
    let width_m = a.half_m.1 + b.half_m.1 * cosine + b.half_m.0 * sine;
    seen.translation.x.abs() < length_m - 0.2 && seen.translation.y.abs() < width_m - 0.1
}

#[test]
fn road_users_keep_clear_of_the_ego_vehicle_even_without_being_hidden() {
    let (mut seen, mut through) = (0, Vec::new());
    for seed in 1..=3 {
        let (drive, traffic) = town(seed, &TrafficConfig::default());
        for step in 0..(drive.duration_s() * 4.0) as usize {
            let time_s = 0.25 * step as f64;
            let ego = drive.pose(time_s);
            for actor in traffic
                .actors
                .iter()
                .filter(|actor| actor.is_visible(time_s))
            {
                let Some(pose) = actor.track.pose(&traffic.route, time_s) else {
                    continue;
                };
                seen += 1;
                if actor.overlaps(&ego, &pose) {
                    through.push((time_s, actor.half_m));
                }
            }
        }
    }
    // Corners of vehicles cut into the ego lane where both turn.
    assert!(seen > 20_000 && through.len() < 20, "{through:?} of {seen}");
}

#[test]
fn road_users_keep_clear_of_each_other() {
    let (mut pairs, mut overlapping) = (0, BTreeMap::<String, usize>::new());
    let (drive, traffic) = town(2, &TrafficConfig::default());
    let name = |track: &Track| {
        format!("{track:?}")
            .split([' ', '('])
            .next()
            .unwrap()
            .to_owned()
            + if format!("{track:?}").contains("Kerb") {
                "Kerb"
            } else {
                ""
            }
    };
    for step in 0..drive.duration_s() as usize {
        let time_s = step as f64;
        let shown = traffic
            .actors
            .iter()
            .filter(|actor| actor.is_visible(time_s));
        let placed: Vec<_> = shown
            .filter_map(|actor| Some((actor, actor.track.pose(&traffic.route, time_s)?)))
            .collect();
        for (i, (a, at)) in placed.iter().enumerate() {
            for (b, there) in &placed[i + 1..] {
                pairs += 1;
                if overlap(a, at, b, there) {
                    *overlapping
                        .entry(name(&a.track) + " " + &name(&b.track))
                        .or_default() += 1;
                }
            }
        }
    }
    println!("{overlapping:?} of {pairs}");
    assert!(
        overlapping.values().sum::<usize>() * 200 < pairs,
        "{overlapping:?} of {pairs} pairs"
    );
}

#[test]
fn velocities_are_those_of_the_motion_and_speeds_are_possible() {
    let (drive, traffic) = town(1, &TrafficConfig::default());
    for step in 0..300 {
        let time_s = 20.0 + 0.5 * step as f64;
        let [before, now, after] = [-0.02, 0.0, 0.02].map(|dt| {
            around(&traffic, drive.as_ref(), time_s + dt, 150.0)
                .into_iter()
                .map(|m| (m.0, (m.1, m.2)))
                .collect::<BTreeMap<_, _>>()
        });
        for (number, (pose, velocity)) in &now {
            let (Some(a), Some(b)) = (before.get(number), after.get(number)) else {
                continue;
            };
            let moved = (b.0.translation.vector - a.0.translation.vector) / 0.04;
            assert!(
                (moved - velocity).norm() < 0.02 + 0.01 * velocity.norm(),
                "{moved} for {velocity}"
            );
            assert!(
                velocity.norm() < 30.0,
                "{number} drives {} m/s",
                velocity.norm()
            );
            let ahead = pose.rotation.inverse() * velocity;
            assert!(
                ahead.x > -0.1 && ahead.y.abs() < 0.5 + 0.1 * ahead.x,
                "{number} at {time_s} s: {ahead}"
            );
        }
    }
}

#[test]
fn any_time_gives_the_same_in_any_order_and_for_the_same_seed_only() {
    let (drive, traffic) = town(1, &TrafficConfig::default());
    let at = |traffic: &Traffic, time_s: f64| around(traffic, drive.as_ref(), time_s, 150.0);
    let forwards: Vec<_> = (0..100).map(|i| at(&traffic, f64::from(i))).collect();
    let backwards: Vec<_> = (0..100).rev().map(|i| at(&traffic, f64::from(i))).collect();
    assert!(forwards.iter().eq(backwards.iter().rev()));
    assert_eq!(
        at(&town(1, &TrafficConfig::default()).1, 50.0),
        forwards[50]
    );
    assert!(
        forwards
            .iter()
            .flatten()
            .all(|(body, ..)| *body >= FIRST_BODY)
    );
}

#[test]
fn number_follows_the_density() {
    let mean = |vehicles_per_km| {
        let config = TrafficConfig {
            vehicles_per_km,
            ..TrafficConfig::none()
        };
        let (drive, traffic) = town(3, &config);
        let seen: usize = (0..200)
            .map(|i| around(&traffic, drive.as_ref(), f64::from(i), 100.0).len())
            .sum();
        seen as f64 / 200.0
    };
    let [none, few, many] = [0.0, 5.0, 40.0].map(mean);
    assert_eq!(none, 0.0);
    assert!(
        (0.5..8.0).contains(&few) && many > 1.8 * few,
        "{few} and {many} within 100 m"
    );
}

#[test]
fn traffic_round_a_small_block_is_nowhere_twice() {
    let drive: Arc<dyn Path> = Arc::new(BlockLoop::new(40.0, 32.0, 9.5, 5.0));
    let streets = Streets::along(drive.as_ref(), 60.0, DrivingSide::Left, 1);
    let traffic = Traffic::new(
        &TrafficConfig::default(),
        drive.clone(),
        60.0,
        &streets,
        DrivingSide::Left,
        1,
    );
    assert!(
        traffic.route.reach_m() < 60.0,
        "{}",
        traffic.route.reach_m()
    );
    let seen: usize = (0..60)
        .map(|i| around(&traffic, drive.as_ref(), f64::from(i), 150.0).len())
        .sum();
    assert!(seen > 60, "{seen}");
}

#[test]
fn vehicle_that_stands_or_turns_on_the_spot_has_traffic_too() {
    use gyre_geometry::Twist;
    for yaw_rate_radps in [0.0, 0.5] {
        let drive: Arc<dyn Path> = Arc::new(Twist {
            yaw_rate_radps,
            ..Twist::default()
        });
        let streets = Streets::along(drive.as_ref(), 60.0, DrivingSide::Right, 1);
        let traffic = Traffic::new(
            &TrafficConfig::default(),
            drive.clone(),
            60.0,
            &streets,
            DrivingSide::Right,
            1,
        );
        let places = (0..60).flat_map(|i| around(&traffic, drive.as_ref(), f64::from(i), 150.0));
        assert!(
            places
                .map(|(_, pose, _)| pose.translation.vector.norm())
                .all(f64::is_finite)
        );
    }
}

#[test]
fn visiting_is_fast() {
    let (drive, traffic) = town(1, &TrafficConfig::default());
    let started = std::time::Instant::now();
    let seen: usize = (0..4000)
        .map(|i| around(&traffic, drive.as_ref(), 0.05 * f64::from(i), 165.0).len())
        .sum();
    let visit_us = started.elapsed().as_secs_f64() * 1e6 / 4000.0;
    println!(
        "{} road users, {} shown and {visit_us:.1} us a visit",
        traffic.actors.len(),
        seen / 4000
    );
    assert!(visit_us < 2000.0, "{visit_us} us");
}

#[test]
fn queues_at_crossroads_wait_for_the_ego_vehicle_and_then_cross() {
    let (mut waiting, mut crossing) = (0, 0);
    for seed in 1..=3 {
        let (drive, traffic) = town(seed, &TrafficConfig::default());
        for actor in traffic.actors.iter() {
            let Track::Crossing(vehicle) = &actor.track else {
                continue;
            };
            waiting += 1;
            let off_m = |time_s: f64| {
                let pose = actor.track.pose(&traffic.route, time_s)?;
                Some((pose.translation.vector - drive.pose(time_s).translation.vector).norm())
            };
            crossing += usize::from(vehicle.until_s + 5.0 < actor.visible_s[1]);
            let nearest_m = (0..100)
                .filter_map(|i| off_m(vehicle.from_s + f64::from(i)))
                .fold(f64::MAX, f64::min);
            assert!(
                nearest_m > 3.0,
                "a vehicle comes out {nearest_m} m from the driven one"
            );
        }
    }
    assert!(
        waiting > 30 && crossing > 10,
        "{crossing} of {waiting} cross"
    );
}
