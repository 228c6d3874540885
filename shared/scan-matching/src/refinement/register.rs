//! Registration of a scan's points on the local map: Levenberg-Marquardt over (x, y, yaw).
//!
//! Minimises sum w (1 - M(T p))^2 over the points p with weights w, M being the map: each point wants to lie where the
//! keyframes saw something.

use multiversion::multiversion;
use nalgebra::{Isometry2, Matrix3, Vector2, Vector3};

use super::{level::Lookup, sweep::Placed};

/// Steps shorter than this end the descent: m, m, rad.
const SETTLED: [f64; 3] = [1e-3, 1e-3, 2e-5];
const FIRST_DAMPING: f64 = 1e-3;
const LEAST_DAMPING: f64 = 1e-4;
const MOST_DAMPING: f64 = 1e4;
/// Points whose sums are kept in single precision.
const BLOCK: usize = 64;

/// Where a descent ended.
#[derive(Debug, Clone, Copy)]
pub(super) struct Match {
    /// Pose of the points' frame in the world.
    pub pose: Isometry2<f64>,
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
pub(super) fn register(map: &Lookup<'_>, points: &Placed, start: &Isometry2<f64>, iterations: usize) -> Match {
    let mut best = Match { pose: *start, normal: linearise(map, points, start) };
    let mut damping = FIRST_DAMPING;
    for _ in 0..iterations {
        let Some(step) = step(&best.normal, damping) else { break };
        let pose = Isometry2::new(
            best.pose.translation.vector + Vector2::new(step.x, step.y),
            best.pose.rotation.angle() + step.z,
        );
        let normal = linearise(map, points, &pose);
        if normal.cost < best.normal.cost {
            best = Match { pose, normal };
            damping = (0.3 * damping).max(LEAST_DAMPING);
            if step.iter().zip(SETTLED).all(|(moved, settled)| moved.abs() < settled) {
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
pub(super) fn linearise(map: &Lookup<'_>, points: &Placed, pose: &Isometry2<f64>) -> Normal {
    let at = (pose.translation.vector - Vector2::from(map.origin)) * f64::from(map.per_m);
    let (sin, cos) = pose.rotation.angle().sin_cos();
    let place = Place { at: at.map(|v| v as f32).into(), sin: sin as f32, cos: cos as f32 };
    let mut total = [0.0_f64; SUMS];
    let columns = points.x_m.chunks(BLOCK).zip(points.y_m.chunks(BLOCK)).zip(points.weight.chunks(BLOCK));
    for ((x_m, y_m), weight) in columns {
        let sums = sum_block(map, x_m, y_m, weight, &place);
        total.iter_mut().zip(sums).for_each(|(total, sum)| *total += f64::from(sum));
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

#[multiversion(targets("x86_64+avx512f+avx512vl+avx512bw+avx512dq", "x86_64+avx2+fma", "aarch64+neon"))]
fn sum_block<'a>(map: &Lookup<'a>, x_m: &[f32], y_m: &[f32], weight: &[f32], place: &Place) -> [f32; SUMS] {
    let (value, slope, last) = (1.0 / map.full, map.per_m / map.full, (map.n - 2) as f32);
    let mut sums = [0.0_f32; SUMS];
    for ((&x, &y), &w) in x_m.iter().zip(y_m).zip(weight) {
        let (rx, ry) = (place.cos * x - place.sin * y, place.sin * x + place.cos * y);
        let (u, v) = (rx * map.per_m + place.at[0], ry * map.per_m + place.at[1]);
        if !(u >= 0.0 && v >= 0.0 && u < last && v < last) {
            sums[0] += w;
            continue;
        }
        let (i, j) = (u as u32 as usize, v as u32 as usize);
        let (across, along) = (u - i as f32, v - j as f32);
        let first = i * map.n + j;
        let (Some(&[a, b]), Some(&[c, d])) =
            (map.sum[first..].first_chunk(), map.sum.get(first + map.n..).and_then(|row| row.first_chunk()))
        else {
            continue;
        };
        let [a, b, c, d] = [a, b, c, d].map(f32::from);
        let (upper, lower) = (a + along * (b - a), c + along * (d - c));
        let m = value * (upper + across * (lower - upper));
        let jx = slope * (lower - upper);
        let jy = slope * ((b - a) + across * ((d - c) - (b - a)));
        let jt = jy * rx - jx * ry;
        let (missing, wx, wy, wt) = (1.0 - m, w * jx, w * jy, w * jt);
        let terms = [
            w * missing * missing,
            w * m,
            wx * missing,
            wy * missing,
            wt * missing,
            wx * jx,
            wx * jy,
            wx * jt,
            wy * jy,
            wy * jt,
            wt * jt,
        ];
        sums.iter_mut().zip(terms).for_each(|(sum, term)| *sum += term);
    }
    sums
}
