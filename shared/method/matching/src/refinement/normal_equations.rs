//! The cost of a pose and its normal equations.
//!
//! The cost is the sum of w (1 - M(T p))^2 over the points p with weights w, where M is the map, 0
//! to 1, and T the pose: each point should lie on an occupied cell.

use gyre_geometry::Pose;
use gyre_simd::simd;
use nalgebra::{Matrix3, Vector2, Vector3};

use super::{map_level::MapView, points::DeskewedPoints};

/// Points whose sums are kept in single precision.
const BLOCK: usize = 64;
const LANES: usize = 16;

/// The cost at a pose, and its normal equations: information * step = right-hand side.
#[derive(Debug, Clone, Copy)]
pub(super) struct NormalEquations {
    /// Sum of w (1 - M)^2.
    pub cost: f64,
    /// Sum of w M.
    pub overlap: f64,
    /// Sum of w (1 - M) dM: minus half the gradient of the cost.
    pub right_hand_side: Vector3<f64>,
    /// Sum of w dM dM^T, over (x, y) along the map's axes in m and yaw about the pose in rad.
    pub information: Matrix3<f64>,
}

impl NormalEquations {
    /// Returns the equations of steps that have no part in a direction of unit length.
    pub fn without(&self, direction: &Vector3<f64>) -> Self {
        let others = Matrix3::identity() - direction * direction.transpose();
        let kept = others * self.information * others;
        Self {
            right_hand_side: others * self.right_hand_side,
            // Any information along it will do: the right-hand side has nothing there.
            information: kept + direction * direction.transpose() * self.information.trace(),
            ..*self
        }
    }
}

pub(super) fn linearise(
    map: &MapView<'_>,
    points: &DeskewedPoints,
    pose: &Pose,
) -> NormalEquations {
    let at = (pose.translation.vector - Vector2::from(map.origin)) * f64::from(map.per_m);
    let (sin, cos) = pose.rotation.angle().sin_cos();
    let place = CellPose {
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
    NormalEquations {
        cost,
        overlap,
        right_hand_side: Vector3::new(gx, gy, gt),
        information: Matrix3::new(xx, xy, xt, xy, yy, yt, xt, yt, tt),
    }
}

/// A pose on the map's array: position in cells, sine and cosine of its yaw.
struct CellPose {
    at: [f32; 2],
    sin: f32,
    cos: f32,
}

/// Sums of the cost, the overlap, the 3 of the right-hand side and the 6 of the information.
const SUMS: usize = 11;

type Lanes = [f32; LANES];

/// The sums over a block of points. The last lanes are filled up with points of weight 0.
#[simd]
fn sum_block<'a>(
    map: &MapView<'a>,
    x_m: &[f32],
    y_m: &[f32],
    weight: &[f32],
    place: &CellPose,
) -> [f32; SUMS] {
    let (value, slope, last) = (1.0 / map.full, map.per_m / map.full, (map.n - 2) as f32);
    let mut sums = [[0.0_f32; LANES]; SUMS];
    for ((x_m, y_m), weight) in x_m
        .chunks(LANES)
        .zip(y_m.chunks(LANES))
        .zip(weight.chunks(LANES))
    {
        let [x, y, w] = [x_m, y_m, weight].map(padded);
        let mut rotated = [[0.0; LANES]; 2];
        let (mut across, mut along, mut inside, mut first) =
            ([0.0; LANES], [0.0; LANES], [0.0; LANES], [0; LANES]);
        for k in 0..LANES {
            let (rx, ry) = (
                place.cos * x[k] - place.sin * y[k],
                place.sin * x[k] + place.cos * y[k],
            );
            let (u, v) = (rx * map.per_m + place.at[0], ry * map.per_m + place.at[1]);
            // A point outside the map, or NaN, reads a cell inside and does not count.
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
fn padded(column: &[f32]) -> Lanes {
    let mut lanes = [0.0; LANES];
    lanes[..column.len()].copy_from_slice(column);
    lanes
}

/// The map at the four corners around each point: the first, the one beside it, and the two in the
/// next row.
#[inline(always)]
fn corners(map: &MapView<'_>, first: &[i32; LANES]) -> [Lanes; 4] {
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
