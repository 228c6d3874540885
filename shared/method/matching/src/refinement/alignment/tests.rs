use nalgebra::{Matrix3, Point2, Vector2};
use proptest::prelude::*;

use super::{
    super::map_level::{Image, MapLevel},
    *,
};

const CELL_M: f64 = 0.5;

fn deskewed(points: &[[f64; 2]]) -> DeskewedPoints {
    DeskewedPoints {
        x_m: points.iter().map(|p| p[0] as f32).collect(),
        y_m: points.iter().map(|p| p[1] as f32).collect(),
        weight: (0..points.len())
            .map(|k| 0.2 + 0.1 * (k % 8) as f32)
            .collect(),
    }
}

/// A map of two keyframes: all points, and every second one slightly displaced.
fn map(points: &[[f64; 2]]) -> MapLevel {
    let mut level = MapLevel::new(CELL_M, 20.0);
    let mut draw = |points: &[[f64; 2]], pose: &Pose| -> Image {
        let mut image = level.new_image();
        level.draw(&deskewed(points), pose, &mut image);
        image
    };
    let images = [
        draw(points, &Pose::identity()),
        draw(
            &points.iter().step_by(2).copied().collect::<Vec<_>>(),
            &Pose::new(Vector2::new(0.3, -0.2), 0.01),
        ),
    ];
    level.sum_images(images.iter());
    level
}

fn points(count: std::ops::Range<usize>) -> impl Strategy<Value = Vec<[f64; 2]>> {
    prop::collection::vec(prop::array::uniform2(-14.0_f64..14.0), count)
}

fn pose(shift_m: f64, turn: f64) -> impl Strategy<Value = Pose> {
    (prop::array::uniform2(-shift_m..shift_m), -turn..turn)
        .prop_map(|(at, yaw)| Pose::new(at.into(), yaw))
}

fn moved(pose: &Pose, unknown: usize, by: f64) -> Pose {
    let step = Vector3::ith(unknown, by);
    Pose::new(
        pose.translation.vector + step.xy(),
        pose.rotation.angle() + step.z,
    )
}

/// Returns whether a point is far enough from its cell's edges for the finite differences to stay
/// in the cell.
fn inside_a_cell(pose: &Pose, [x, y]: &[f64; 2]) -> bool {
    (pose * Point2::new(*x, *y)).coords.iter().all(|v| {
        let share = (v / CELL_M).rem_euclid(1.0);
        (0.1..0.9).contains(&share)
    })
}

proptest! {
    #[test]
    fn normal_equations_are_the_derivatives_of_the_cost(world in points(20..200), pose in pose(1.0, 0.2)) {
        const STEPS: [f64; 3] = [0.02, 0.02, 0.001];
        let level = map(&world);
        let view = level.view();
        let kept: Vec<[f64; 2]> = world.iter().filter(|p| inside_a_cell(&pose, p)).copied().collect();
        let all = deskewed(&kept);
        let (mut right_hand_side, mut information) = (Vector3::zeros(), Matrix3::zeros());
        for k in 0..kept.len() {
            let one = DeskewedPoints { x_m: vec![all.x_m[k]], y_m: vec![all.y_m[k]], weight: vec![all.weight[k]] };
            let at = |unknown: usize, by: f64| linearise(&view, &one, &moved(&pose, unknown, by));
            let difference = |value: fn(&NormalEquations) -> f64| Vector3::from_fn(|unknown, _| {
                let step = STEPS[unknown];
                (value(&at(unknown, step)) - value(&at(unknown, -step))) / (2.0 * step)
            });
            right_hand_side -= 0.5 * difference(|normal| normal.cost);
            let slope = difference(|normal| normal.overlap);
            information += slope * slope.transpose() / f64::from(one.weight[0]);
        }
        let normal = linearise(&view, &all, &pose);
        // The lever of the yaw is up to 20 m.
        let lever = Vector3::new(1.0, 1.0, 20.0);
        let scale = kept.len() as f64;
        for i in 0..3 {
            prop_assert!((normal.right_hand_side[i] - right_hand_side[i]).abs() < 2e-3 * scale * lever[i], "{normal:?} {right_hand_side}");
            for j in 0..3 {
                let (actual, expected) = (normal.information[(i, j)], information[(i, j)]);
                prop_assert!((actual - expected).abs() < 4e-3 * scale * lever[i] * lever[j], "{i} {j}: {actual} {expected}");
            }
        }
    }

    #[test]
    fn cost_and_overlap_are_sums_over_the_points(world in points(1..200), pose in pose(30.0, 3.0)) {
        let level = map(&world);
        let (view, all) = (level.view(), deskewed(&world));
        let (mut cost, mut overlap) = (0.0, 0.0);
        for k in 0..world.len() {
            let one = DeskewedPoints { x_m: vec![all.x_m[k]], y_m: vec![all.y_m[k]], weight: vec![all.weight[k]] };
            let normal = linearise(&view, &one, &pose);
            let (w, m) = (f64::from(all.weight[k]), normal.overlap / f64::from(all.weight[k]));
            prop_assert!((0.0..=1.0).contains(&m));
            prop_assert!((normal.cost - w * (1.0 - m).powi(2)).abs() < 1e-6);
            (cost, overlap) = (cost + normal.cost, overlap + normal.overlap);
        }
        let normal = linearise(&view, &all, &pose);
        prop_assert!((normal.cost - cost).abs() < 1e-4 && (normal.overlap - overlap).abs() < 1e-4);
    }

    #[test]
    fn more_iterations_never_raise_the_cost(world in points(5..200), initial in pose(3.0, 0.5)) {
        let level = map(&world);
        let (view, points) = (level.view(), deskewed(&world));
        let mut cost = linearise(&view, &points, &initial).cost;
        for iterations in 0..12 {
            let found = align(&view, &points, &initial, iterations, None);
            prop_assert!(found.normal.cost <= cost, "{} after {cost} at step {iterations}", found.normal.cost);
            prop_assert_eq!(linearise(&view, &points, &found.pose).cost, found.normal.cost);
            cost = found.normal.cost;
        }
    }

    #[test]
    fn points_are_aligned_with_their_own_image(world in points(60..200), initial in pose(0.35, 0.02)) {
        let mut level = MapLevel::new(CELL_M, 20.0);
        let (points, mut image) = (deskewed(&world), level.new_image());
        level.draw(&points, &Pose::identity(), &mut image);
        level.sum_images(std::iter::once(&image));
        let found = align(&level.view(), &points, &initial, 30, None).pose;
        prop_assert!(found.translation.vector.norm() < 0.15 && found.rotation.angle().abs() < 0.015, "{found}");
    }
}

#[test]
fn an_empty_map_or_scan_leaves_the_initial_pose() {
    let initial = Pose::new(Vector2::new(1.0, 2.0), 0.3);
    let (empty, full) = (MapLevel::new(CELL_M, 20.0), map(&[[1.0, 2.0], [-3.0, 4.0]]));
    assert_eq!(
        align(&empty.view(), &deskewed(&[[1.0, 2.0]]), &initial, 10, None).pose,
        initial
    );
    assert_eq!(
        align(&full.view(), &deskewed(&[]), &initial, 10, None).pose,
        initial
    );
}
