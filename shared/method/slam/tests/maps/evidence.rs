//! The evidence that keyframes leave in the cells.

use gyre_geometry::{SparsePoint, Twist, pose};
use gyre_slam::mapping::MapOptions;
use nalgebra::Point2;

use crate::maps::scenes::*;

#[test]
fn a_wall_seen_from_two_poses_is_one_wall() {
    let mut evidence = drawn(&drive(40, &wall()));
    let across: Vec<u8> = (-10..=10)
        .map(|k| cell(&mut evidence, 0.1, 20.1 + 0.2 * f64::from(k)).evidence)
        .collect();
    let highest = across.iter().max().unwrap();
    let bright = across.iter().filter(|at| **at > highest / 2).count();
    assert!((1..=3).contains(&bright), "{across:?}");
    assert!(*highest > 100, "{across:?}");
    assert_eq!([across[0], across[20]], [0, 0], "{across:?}");
}

#[test]
fn a_wall_is_as_bright_in_larger_cells() {
    let of = |cell_m: f64| {
        let options = MapOptions {
            cell_m,
            ..MapOptions::default()
        };
        let mut evidence = drawn_with(&options, &drive(40, &wall()));
        // The wall is between two rows of larger cells.
        let rows = [19.9, 20.1].map(|y_m| cell(&mut evidence, 0.1, y_m).evidence);
        f64::from(rows[0].max(rows[1]))
    };
    let (small, [twice, fourfold]) = (of(0.2), [0.4, 0.8].map(of));
    for larger in [twice, fourfold] {
        assert!(
            (0.6..1.2).contains(&(larger / small)),
            "{small} {twice} {fourfold}"
        );
    }
}

#[test]
fn doppler_and_motion_leave_no_second_wall() {
    // A wall square ahead of a keyframe at 10 m/s on the way there, and behind it on the way back.
    let measured = |x_m: f32| SparsePoint::from([x_m, 0.0, 0.0, 1.0, 0.042]);
    let twist = Twist::from([10.0, 0.0, 0.0]);
    let mut there = keyframe(0, &pose(0.0, 0.0, 0.0), &[]);
    (there.twist, there.points) = (twist, vec![measured(20.1 - 0.42)]);
    let back = pose(0.0, 0.0, std::f64::consts::PI);
    let mut again = keyframe(1, &back, &[]);
    (again.twist, again.points) = (twist, vec![measured(-20.1 - 0.42)]);
    let mut evidence = drawn(&[(pose(0.0, 0.0, 0.0), there), (back, again)]);
    let at = |x_m: f64, evidence: &mut _| cell(evidence, x_m, 0.1).evidence;
    let [before, wall, behind] = [19.7, 20.1, 20.5].map(|x_m| at(x_m, &mut evidence));
    assert!(
        wall > 50 && before == 0 && behind == 0,
        "{before} {wall} {behind}"
    );
}

#[test]
fn something_seen_by_one_of_many_views_fades() {
    let (car, wall) = (Point2::new(0.1, 10.1), wall());
    let mut drive = drive(40, &wall);
    let with_car: Vec<Point2<f64>> = wall.iter().copied().chain([car]).collect();
    let (at, _) = drive[20];
    drive[20].1 = keyframe(20, &at, &with_car);
    let mut once = drawn(&[drive[20].clone()]);
    let mut often = drawn(&drive);
    let [once, often] =
        [&mut once, &mut often].map(|evidence| cell(evidence, car.x, car.y).evidence);
    assert!(once > 100 && often < once / 4, "{once} then {often}");
}

#[test]
fn a_street_driven_often_is_no_brighter() {
    let once = drive(40, &wall());
    let again = once.iter().cloned().map(|(at, mut keyframe)| {
        keyframe.seq += 40;
        (at, keyframe)
    });
    let twice: Vec<_> = once.iter().cloned().chain(again).collect();
    let [once, twice] = [once, twice].map(|drive| cell(&mut drawn(&drive), 0.1, 20.1).evidence);
    assert!(once.abs_diff(twice) <= 4, "{once} and {twice}");
}

#[test]
fn a_cell_beyond_the_farthest_return_was_not_looked_at() {
    let mut evidence = drawn(&drive(1, &wall()));
    assert!(cell(&mut evidence, -0.5, 15.0).looked > 0);
    assert_eq!(cell(&mut evidence, -0.5, 25.0).looked, 0);
    assert_eq!(cell(&mut evidence, -0.5, -15.0).looked, 0);
    // Nearer than the nearest returns.
    assert_eq!(cell(&mut evidence, -0.5, 2.0).looked, 0);
}

#[test]
fn a_corrected_pose_moves_its_keyframe_and_leaves_no_trace() {
    let mut drive = drive(30, &wall());
    let mut evidence = drawn(&drive);
    let corrected = pose(900.0, 40.0, 1.0);
    drive[7].0 = corrected;
    assert!(evidence.has_moved(7, &corrected));
    evidence.draw(&drive[7].1, &corrected).unwrap();
    assert!(!evidence.has_moved(7, &corrected));
    assert_eq!(images(&mut evidence), images(&mut drawn(&drive)));
}

#[test]
fn a_keyframe_is_drawn_anew_beyond_a_fraction_of_a_cell() {
    let evidence = drawn(&drive(1, &wall()));
    let at = pose(-0.5, 0.0, 0.0);
    assert!(!evidence.has_moved(0, &(at * pose(0.05, 0.0, 0.0))));
    assert!(evidence.has_moved(0, &(at * pose(0.07, 0.0, 0.0))));
    // 0.06 degrees are 0.08 m at 80 m.
    assert!(evidence.has_moved(0, &(at * pose(0.0, 0.0, 0.001))));
    assert!(evidence.has_moved(1, &at));
}

#[test]
fn a_point_that_is_nowhere_is_left_out() {
    let at = pose(0.0, 0.0, 0.0);
    let mut strange = keyframe(0, &at, &wall());
    let whole = images(&mut drawn(&[(at, strange.clone())]));
    for (x_m, weight) in [
        (f32::NAN, 1.0),
        (f32::INFINITY, 1.0),
        (3e8, f32::NAN),
        (30.0, -1.0),
    ] {
        strange
            .points
            .push(SparsePoint::from([x_m, 0.0, 0.0, weight, 0.0]));
    }
    assert_eq!(images(&mut drawn(&[(at, strange)])), whole);
}

#[test]
fn options_out_of_bounds_are_refused_by_name() {
    type Change = fn(&mut MapOptions);
    let reach = "beyond near_m, and 1 to 2000 cells";
    let wrong: [(Change, &str, &str); 8] = [
        (|it| it.cell_m = 0.0, "cell_m is 0", "0.05 to 5"),
        (|it| it.cell_m = f64::NAN, "cell_m is NaN", "0.05 to 5"),
        (|it| it.near_m = -1.0, "near_m is -1", "0 to 1000"),
        (|it| it.reach_m = 5.0, "reach_m is 5", reach),
        (|it| it.reach_m = 401.0, "reach_m is 401", reach),
        (
            |it| it.half_weight_m = 0.0,
            "half_weight_m is 0",
            "0.1 to 10000",
        ),
        (|it| it.bearing_deg = 5.1, "bearing_deg is 5.1", "0 to 5"),
        (|it| it.bearing_deg = -0.1, "bearing_deg is -0.1", "0 to 5"),
    ];
    for (change, found, bounds) in wrong {
        let mut options = MapOptions::default();
        change(&mut options);
        let refused = options.validate().unwrap_err().to_string();
        assert_eq!(refused, format!("the map's {found}, but must be {bounds}"));
    }
    assert!(MapOptions::default().validate().is_ok());
}
