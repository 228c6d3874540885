//! Registration of a scan's points on the local map: Levenberg-Marquardt over (x, y, yaw).
//!
//! Minimises sum w (1 - M(T p))^2 over the points p with weights w, M being the map: each point wants to lie where the
//! keyframes saw something.

use gyre_geometry::Pose;
use gyre_simd::simd;
use nalgebra::{Matrix3, Vector2, Vector3};

use super::{level::Lookup, sweep::Placed};

/// Steps shorter than this end the descent: m, m, rad.
const SETTLED: [f64; 3] = [1e-3, 1e-3, 2e-5];
const FIRST_DAMPING: f64 = 1e-3;
const LEAST_DAMPING: f64 = 1e-4;
const MOST_DAMPING: f64 = 1e4;
/// Points whose sums are kept in single precision.
const BLOCK: usize = 64;
/// Points that are worked on side by side.
const LANES: usize = 16;

/// Where a descent ended.
#[derive(Debug, Clone, Copy)]
pub(super) struct Match {
    /// Pose of the points' frame in the world.
    pub pose: Pose,
    pub normal: Normal,
}

/// The cost at a pose, and its slope.
#[derive(Debug, Clone, Copy)]
pub(super) struct Normal {
    /// Sum of w (1 - M)^2.
    pub cost: f64,
    /// Sum of w M.
    pub overlap: f64,
    /// Downhill: sum of w (1 - M) dM.
    pub downhill: Vector3<f64>,
    /// Sum of w dM dM^T, over (x, y) along the world's axes in m and yaw about the pose in rad.
    pub information: Matrix3<f64>,
}

/// Descends from `start`.
pub(super) fn register(
    map: &Lookup<'_>,
    points: &Placed,
    start: &Pose,
    iterations: usize,
) -> Match {
    let mut best = Match {
        pose: *start,
        normal: linearise(map, points, start),
    };
    let mut damping = FIRST_DAMPING;
    for _ in 0..iterations {
        let Some(step) = step(&best.normal, damping) else {
            break;
        };
        let pose = Pose::new(
            best.pose.translation.vector + Vector2::new(step.x, step.y),
            best.pose.rotation.angle() + step.z,
        );
        let normal = linearise(map, points, &pose);
        if normal.cost < best.normal.cost {
            best = Match { pose, normal };
            damping = (0.3 * damping).max(LEAST_DAMPING);
            if step
                .iter()
                .zip(SETTLED)
                .all(|(moved, settled)| moved.abs() < settled)
            {
                break;
            }
        } else {
            damping *= 8.0;
            if damping > MOST_DAMPING {
                break;
            }
        }
    }
    best
}

fn step(normal: &Normal, damping: f64) -> Option<Vector3<f64>> {
    let mut damped = normal.information;
    for k in 0..3 {
        damped[(k, k)] *= 1.0 + damping;
    }
    let step = damped.cholesky()?.solve(&normal.downhill);
    step.iter().all(|s| s.is_finite()).then_some(step)
}

/// The cost and its slope at a pose.
pub(super) fn linearise(map: &Lookup<'_>, points: &Placed, pose: &Pose) -> Normal {
    let at = (pose.translation.vector - Vector2::from(map.origin)) * f64::from(map.per_m);
    let (sin, cos) = pose.rotation.angle().sin_cos();
    let place = Place {
        at: at.map(|v| v as f32).into(),
        sin: sin as f32,
        cos: cos as f32,
    };
    let mut total = [0.0_f64; SUMS];
    let columns = points
        .x_m
        .chunks(BLOCK)
        .zip(points.y_m.chunks(BLOCK))
        .zip(points.weight.chunks(BLOCK));
    for ((x_m, y_m), weight) in columns {
        let sums = sum_block(map, x_m, y_m, weight, &place);
        total
            .iter_mut()
            .zip(sums)
            .for_each(|(total, sum)| *total += f64::from(sum));
    }
    let [cost, overlap, gx, gy, gt, xx, xy, xt, yy, yt, tt] = total;
    Normal {
        cost,
        overlap,
        downhill: Vector3::new(gx, gy, gt),
        information: Matrix3::new(xx, xy, xt, xy, yy, yt, xt, yt, tt),
    }
}

/// A pose on the map's array: place in cells, sine and cosine of its yaw.
struct Place {
    at: [f32; 2],
    sin: f32,
    cos: f32,
}

/// Cost, overlap, the slope's 3 and the information's 6 sums.
const SUMS: usize = 11;

/// A value a point.
type Lanes = [f32; LANES];

/// What a block of points adds. Points left over are filled up with some of no weight.
#[simd]
fn sum_block<'a>(
    map: &Lookup<'a>,
    x_m: &[f32],
    y_m: &[f32],
    weight: &[f32],
    place: &Place,
) -> [f32; SUMS] {
    let (value, slope, last) = (1.0 / map.full, map.per_m / map.full, (map.n - 2) as f32);
    let mut sums = [[0.0_f32; LANES]; SUMS];
    for ((x_m, y_m), weight) in x_m
        .chunks(LANES)
        .zip(y_m.chunks(LANES))
        .zip(weight.chunks(LANES))
    {
        let [x, y, w] = [x_m, y_m, weight].map(filled_up);
        let mut rotated = [[0.0; LANES]; 2];
        let (mut across, mut along, mut inside, mut first) =
            ([0.0; LANES], [0.0; LANES], [0.0; LANES], [0; LANES]);
        for k in 0..LANES {
            let (rx, ry) = (
                place.cos * x[k] - place.sin * y[k],
                place.sin * x[k] + place.cos * y[k],
            );
            let (u, v) = (rx * map.per_m + place.at[0], ry * map.per_m + place.at[1]);
            // A point outside, or nowhere, reads a cell inside and does not count.
            let (cell_u, cell_v) = (u.max(0.0).min(last) as i32, v.max(0.0).min(last) as i32);
            inside[k] = f32::from(u8::from((u >= 0.0) & (v >= 0.0) & (u < last) & (v < last)));
            (across[k], along[k]) = (u - cell_u as f32, v - cell_v as f32);
            first[k] = cell_u * map.n as i32 + cell_v;
            (rotated[0][k], rotated[1][k]) = (rx, ry);
        }
        let [a, b, c, d] = corners(map, &first);
        for k in 0..LANES {
            let (upper, lower) = (
                a[k] + along[k] * (b[k] - a[k]),
                c[k] + along[k] * (d[k] - c[k]),
            );
            let (left, right) = (
                a[k] + across[k] * (c[k] - a[k]),
                b[k] + across[k] * (d[k] - b[k]),
            );
            let seen = |term: f32| if inside[k] > 0.0 { term } else { 0.0 };
            let m = seen(value * (upper + across[k] * (lower - upper)));
            let (jx, jy) = (seen(slope * (lower - upper)), seen(slope * (right - left)));
            let jt = seen(jy * rotated[0][k] - jx * rotated[1][k]);
            let (missing, wx, wy, wt) = (1.0 - m, w[k] * jx, w[k] * jy, w[k] * jt);
            sums[0][k] += w[k] * missing * missing;
            sums[1][k] += w[k] * m;
            sums[2][k] += wx * missing;
            sums[3][k] += wy * missing;
            sums[4][k] += wt * missing;
            sums[5][k] += wx * jx;
            sums[6][k] += wx * jy;
            sums[7][k] += wx * jt;
            sums[8][k] += wy * jy;
            sums[9][k] += wy * jt;
            sums[10][k] += wt * jt;
        }
    }
    sums.map(|lanes| lanes.iter().sum())
}

#[inline(always)]
fn filled_up(column: &[f32]) -> Lanes {
    let mut lanes = [0.0; LANES];
    lanes[..column.len()].copy_from_slice(column);
    lanes
}

/// The map at the four corners about each point: the first, the one beside it, and those a row on.
#[inline(always)]
fn corners(map: &Lookup<'_>, first: &[i32; LANES]) -> [Lanes; 4] {
    let mut corners = [[0.0; LANES]; 4];
    for (k, first) in first.iter().enumerate() {
        let first = *first as usize;
        let ([a, b], [c, d]) = (two(&map.sum[first..]), two(&map.sum[first + map.n..]));
        for (corner, value) in corners.iter_mut().zip([a, b, c, d]) {
            corner[k] = f32::from(value);
        }
    }
    corners
}

#[inline(always)]
fn two(values: &[u16]) -> [u16; 2] {
    [values[0], values[1]]
}

#[cfg(test)]
mod tests {
    use nalgebra::Point2;
    use proptest::prelude::*;

    use super::{
        super::level::{Image, Level},
        *,
    };

    const CELL_M: f64 = 0.5;

    fn placed(points: &[[f64; 2]]) -> Placed {
        Placed {
            x_m: points.iter().map(|p| p[0] as f32).collect(),
            y_m: points.iter().map(|p| p[1] as f32).collect(),
            weight: (0..points.len())
                .map(|k| 0.2 + 0.1 * (k % 8) as f32)
                .collect(),
        }
    }

    /// A map of two keyframes: all points, and every second one a little aside.
    fn map(points: &[[f64; 2]]) -> Level {
        let mut level = Level::new(CELL_M, 20.0);
        let mut draw = |points: &[[f64; 2]], pose: &Pose| -> Image {
            let mut image = level.new_image();
            level.draw(&placed(points), pose, &mut image);
            image
        };
        let images = [
            draw(points, &Pose::identity()),
            draw(
                &points.iter().step_by(2).copied().collect::<Vec<_>>(),
                &Pose::new(Vector2::new(0.3, -0.2), 0.01),
            ),
        ];
        level.stack(images.iter());
        level
    }

    fn points(count: std::ops::Range<usize>) -> impl Strategy<Value = Vec<[f64; 2]>> {
        prop::collection::vec(prop::array::uniform2(-14.0_f64..14.0), count)
    }

    fn pose(shift_m: f64, turn: f64) -> impl Strategy<Value = Pose> {
        (prop::array::uniform2(-shift_m..shift_m), -turn..turn)
            .prop_map(|(at, yaw)| Pose::new(at.into(), yaw))
    }

    /// The pose, moved along one of its three unknowns.
    fn moved(pose: &Pose, unknown: usize, by: f64) -> Pose {
        let step = Vector3::ith(unknown, by);
        Pose::new(
            pose.translation.vector + step.xy(),
            pose.rotation.angle() + step.z,
        )
    }

    /// Whether a point is so far from its cell's edges that the steps of the differences do not leave it.
    fn inside_a_cell(pose: &Pose, [x, y]: &[f64; 2]) -> bool {
        (pose * Point2::new(*x, *y)).coords.iter().all(|v| {
            let share = (v / CELL_M).rem_euclid(1.0);
            (0.1..0.9).contains(&share)
        })
    }

    proptest! {
        #[test]
        fn slope_and_information_are_those_of_the_cost(world in points(20..200), pose in pose(1.0, 0.2)) {
            const STEPS: [f64; 3] = [0.02, 0.02, 0.001];
            let level = map(&world);
            let lookup = level.lookup();
            let kept: Vec<[f64; 2]> = world.iter().filter(|p| inside_a_cell(&pose, p)).copied().collect();
            let all = placed(&kept);
            let (mut downhill, mut information) = (Vector3::zeros(), Matrix3::zeros());
            for k in 0..kept.len() {
                let one = Placed { x_m: vec![all.x_m[k]], y_m: vec![all.y_m[k]], weight: vec![all.weight[k]] };
                let at = |unknown: usize, by: f64| linearise(&lookup, &one, &moved(&pose, unknown, by));
                let difference = |value: fn(&Normal) -> f64| Vector3::from_fn(|unknown, _| {
                    let step = STEPS[unknown];
                    (value(&at(unknown, step)) - value(&at(unknown, -step))) / (2.0 * step)
                });
                downhill -= 0.5 * difference(|normal| normal.cost);
                let slope = difference(|normal| normal.overlap);
                information += slope * slope.transpose() / f64::from(one.weight[0]);
            }
            let normal = linearise(&lookup, &all, &pose);
            // A turn's lever is up to 20 m.
            let lever = Vector3::new(1.0, 1.0, 20.0);
            let scale = kept.len() as f64;
            for i in 0..3 {
                prop_assert!((normal.downhill[i] - downhill[i]).abs() < 2e-3 * scale * lever[i], "{normal:?} {downhill}");
                for j in 0..3 {
                    let (actual, expected) = (normal.information[(i, j)], information[(i, j)]);
                    prop_assert!((actual - expected).abs() < 4e-3 * scale * lever[i] * lever[j], "{i} {j}: {actual} {expected}");
                }
            }
        }

        #[test]
        fn cost_and_overlap_are_sums_over_the_points(world in points(1..200), pose in pose(30.0, 3.0)) {
            let level = map(&world);
            let (lookup, all) = (level.lookup(), placed(&world));
            let (mut cost, mut overlap) = (0.0, 0.0);
            for k in 0..world.len() {
                let one = Placed { x_m: vec![all.x_m[k]], y_m: vec![all.y_m[k]], weight: vec![all.weight[k]] };
                let normal = linearise(&lookup, &one, &pose);
                let (w, m) = (f64::from(all.weight[k]), normal.overlap / f64::from(all.weight[k]));
                prop_assert!((0.0..=1.0).contains(&m));
                prop_assert!((normal.cost - w * (1.0 - m).powi(2)).abs() < 1e-6);
                (cost, overlap) = (cost + normal.cost, overlap + normal.overlap);
            }
            let normal = linearise(&lookup, &all, &pose);
            prop_assert!((normal.cost - cost).abs() < 1e-4 && (normal.overlap - overlap).abs() < 1e-4);
        }

        #[test]
        fn a_descent_never_raises_the_cost(world in points(5..200), start in pose(3.0, 0.5)) {
            let level = map(&world);
            let (lookup, points) = (level.lookup(), placed(&world));
            let mut cost = linearise(&lookup, &points, &start).cost;
            for iterations in 0..12 {
                let found = register(&lookup, &points, &start, iterations);
                prop_assert!(found.normal.cost <= cost, "{} after {cost} at step {iterations}", found.normal.cost);
                prop_assert_eq!(linearise(&lookup, &points, &found.pose).cost, found.normal.cost);
                cost = found.normal.cost;
            }
        }

        #[test]
        fn points_slide_back_to_where_they_were_drawn(world in points(60..200), start in pose(0.35, 0.02)) {
            let mut level = Level::new(CELL_M, 20.0);
            let (points, mut image) = (placed(&world), level.new_image());
            level.draw(&points, &Pose::identity(), &mut image);
            level.stack(std::iter::once(&image));
            let found = register(&level.lookup(), &points, &start, 30).pose;
            prop_assert!(found.translation.vector.norm() < 0.15 && found.rotation.angle().abs() < 0.015, "{found}");
        }
    }

    #[test]
    fn an_empty_map_or_scan_leaves_the_start() {
        let start = Pose::new(Vector2::new(1.0, 2.0), 0.3);
        let (empty, full) = (Level::new(CELL_M, 20.0), map(&[[1.0, 2.0], [-3.0, 4.0]]));
        assert_eq!(
            register(&empty.lookup(), &placed(&[[1.0, 2.0]]), &start, 10).pose,
            start
        );
        assert_eq!(
            register(&full.lookup(), &placed(&[]), &start, 10).pose,
            start
        );
    }
}
