use super::*;
use crate::path::Path;
use crate::streets::Streets;

fn drives() -> impl Iterator<Item = (TownDrive, SplinePath)> {
    let city = TownDrive {
        length_m: 4000.0,
        speed_mps: 13.9,
        lateral_acceleration_mps2: 2.2,
        driving_side: DrivingSide::Left,
    };
    // Checchin et al., 2010: 1135 m of campus at 0 to 25 km/h.
    let campus = TownDrive {
        length_m: 1135.0,
        speed_mps: 25.0 / 3.6,
        driving_side: DrivingSide::Right,
        ..city
    };
    (1..=6).flat_map(move |seed| [city, campus].map(|drive| (drive, drive.path(seed))))
}

/// The n-th difference quotients of the values.
fn derivative(
    values: &[nalgebra::Vector2<f64>],
    order: usize,
    step: f64,
) -> Vec<nalgebra::Vector2<f64>> {
    (0..order).fold(values.to_vec(), |values, _| {
        values.windows(2).map(|w| (w[1] - w[0]) / step).collect()
    })
}

#[test]
fn drives_have_their_length_and_start_at_the_origin() {
    for (wanted, drive) in drives() {
        let place = |i: usize| drive.pose(i as f64 * 0.1).translation.vector;
        let driven: f64 = (0..(drive.duration_s() * 10.0) as usize)
            .map(|i| (place(i + 1) - place(i)).norm())
            .sum();
        assert!(
            (driven - wanted.length_m).abs() < 0.01 * wanted.length_m + 2.0,
            "{driven} for {wanted:?}"
        );
        assert!(place(0).norm() < 0.01);
    }
}

#[test]
fn speed_acceleration_and_jerk_are_limited() {
    for (wanted, drive) in drives() {
        let velocities: Vec<_> = (0..(drive.duration_s() * 20.0) as usize)
            .map(|i| drive.velocity(i as f64 * 0.05))
            .collect();
        let largest = |order| {
            derivative(&velocities, order, 0.05)
                .iter()
                .map(|v| v.norm())
                .fold(0.0, f64::max)
        };
        for (i, v) in derivative(&velocities, 2, 0.05).iter().enumerate() {
            if v.norm() > 6.0 {
                println!(
                    "{} {:?} {:?} {:?}",
                    i as f64 * 0.05,
                    drive.pose(i as f64 * 0.05).rotation.inverse() * v,
                    velocities[i].norm(),
                    drive.pose(i as f64 * 0.05).rotation.angle()
                );
            }
        }
        assert!(largest(0) < wanted.speed_mps * 1.01, "{} m/s", largest(0));
        assert!(largest(1) < 3.2, "{} m/s2", largest(1));
        assert!(largest(2) < 6.0, "{} m/s3", largest(2));
        let still = velocities.iter().filter(|v| v.norm() < 0.01).count() as f64 * 0.05;
        assert!(still > 5.0, "stands for {still} s only");
    }
}

#[test]
fn heading_is_the_direction_of_travel() {
    for (_, drive) in drives() {
        for i in 0..(drive.duration_s() * 10.0) as usize {
            let time = i as f64 * 0.1;
            let ahead = drive.pose(time).rotation.inverse() * drive.velocity(time);
            assert!(ahead.x > -0.03 && ahead.y.abs() < 0.12, "{time} s: {ahead}");
        }
    }
}

#[test]
fn streets_are_repeated_in_both_directions_and_never_side_by_side() {
    for (wanted, drive) in drives() {
        let poses: Vec<_> = (0..(drive.duration_s() * 2.0) as usize)
            .map(|i| drive.pose(i as f64 * 0.5))
            .collect();
        let straight =
            |i: &usize| *i > 2 && poses[i - 2].rotation.angle_to(&poses[*i].rotation).abs() < 0.03;
        let straights: Vec<usize> = (0..poses.len()).filter(straight).collect();
        let (mut again, mut back) = (0, 0);
        for (n, i) in straights.iter().enumerate() {
            for later in straights[n..].iter().filter(|later| **later > i + 60) {
                let (pose, later) = (poses[*i], poses[*later]);
                let seen = pose.inverse() * later;
                let parallel =
                    seen.rotation.cos_angle().abs() > 0.97 && seen.translation.x.abs() < 3.0;
                let beside_m = seen.translation.y.abs();
                again += usize::from(parallel && beside_m < 1.0 && seen.rotation.cos_angle() > 0.0);
                back += usize::from(
                    parallel && (2.5..4.0).contains(&beside_m) && seen.rotation.cos_angle() < 0.0,
                );
                assert!(
                    !parallel || !(6.0..38.0).contains(&beside_m),
                    "streets {beside_m} m apart"
                );
            }
        }
        assert!(again > 20, "{wanted:?} repeats no street");
        assert!(
            back > 10 || wanted.length_m < 2000.0,
            "{wanted:?} drives no street in the opposite direction"
        );
    }
}

#[test]
fn streets_along_a_town_drive_are_those_of_its_plan() {
    for (wanted, drive) in drives() {
        let streets = Streets::along(&drive, f64::INFINITY, wanted.driving_side, 1);
        let driven: f64 = streets
            .streets()
            .iter()
            .filter(|s| s.driven)
            .map(|s| s.length_m())
            .sum();
        assert!(
            driven < 0.9 * wanted.length_m,
            "{driven} m of streets for {} m",
            wanted.length_m
        );
    }
}
