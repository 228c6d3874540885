//! The speed along a lane: limits, bends, braking, waiting, limited jerk.

use rand::Rng;

use super::lane::Lane;
use super::steered::SteeredLane;

/// Acceleration and braking along the lane, metres a second squared, as usual in towns.
const SPEED_UP_MPS2: f64 = 1.4;
const BRAKE_MPS2: f64 = 1.8;
/// Share of the junctions at which the vehicle waits, and duration, seconds.
const WAITING: f64 = 0.3;
const WAIT_S: std::ops::Range<f64> = 3.0..18.0;
/// Standstill before the start and after the end, seconds.
const REST_S: f64 = 3.0;
/// Distance between nodes of the table of speeds, metres.
const STEP_M: f64 = 0.25;
/// Windows of the moving averages that limit the jerk, applied one after the other, seconds.
const GRADUAL_S: [f64; 2] = [0.9, 0.6];
/// Twice the minimum mean speed between two nodes, metres a second.
const CREEP_MPS: f64 = 0.1;
/// Time between the values that are averaged, seconds.
const FINE_S: f64 = 0.05;

/// The limits of the speed.
pub struct Limits {
    /// Highest speed limit, metres a second.
    pub speed_mps: f64,
    /// Lateral acceleration in bends, metres a second squared.
    pub lateral_mps2: f64,
}

/// Distance along the lane every `step_s`, metres, over `length_m`, with a standstill at both ends.
pub fn progress(
    steered: &SteeredLane,
    lane: &Lane,
    limits: &Limits,
    length_m: f64,
    rng: &mut impl Rng,
    step_s: f64,
) -> Vec<f64> {
    let count = (length_m.min(steered.length_m) / STEP_M) as usize;
    let per_place = steered.length_m / (lane.places.len() - 1) as f64;
    let place =
        |node: usize| ((node as f64 * STEP_M / per_place) as usize).min(lane.places.len() - 1);
    let fastest = |node: usize| {
        let bend =
            (limits.lateral_mps2 / curvature(steered, node as f64 * STEP_M).max(1e-6)).sqrt();
        bend.min(limits.speed_mps * lane.limits[place(node)])
    };
    let mut speeds: Vec<f64> = (0..=count).map(fastest).collect();
    let mut waits_s = vec![0.0; count + 1];
    (waits_s[0], waits_s[count]) = (REST_S, REST_S);
    for wait in &lane.waits {
        let node = (*wait as f64 * per_place / STEP_M) as usize;
        if rng.random_bool(WAITING) && node < count {
            waits_s[node] = rng.random_range(WAIT_S);
        }
    }
    for (speed, _) in speeds
        .iter_mut()
        .zip(&waits_s)
        .filter(|(_, wait_s)| **wait_s > 0.0)
    {
        *speed = 0.0;
    }
    brake_and_speed_up(&mut speeds);
    gradual(
        &timed(&speeds, &waits_s),
        (step_s / FINE_S).round() as usize,
    )
}

fn curvature(steered: &SteeredLane, along_m: f64) -> f64 {
    let heading = |at: f64| {
        let [x, y] = steered.curve.slope(at);
        nalgebra::Vector2::new(x, y)
    };
    heading(along_m - 0.5).angle(&heading(along_m + 0.5))
}

fn brake_and_speed_up(speeds: &mut [f64]) {
    for i in 1..speeds.len() {
        speeds[i] = speeds[i].min((speeds[i - 1].powi(2) + 2.0 * SPEED_UP_MPS2 * STEP_M).sqrt());
    }
    for i in (1..speeds.len()).rev() {
        speeds[i - 1] = speeds[i - 1].min((speeds[i].powi(2) + 2.0 * BRAKE_MPS2 * STEP_M).sqrt());
    }
}

/// Distance along the lane at even times, metres.
fn timed(speeds: &[f64], waits_s: &[f64]) -> Vec<f64> {
    let mut along_m = Vec::new();
    let mut until_s = 0.0;
    let mut fill = |from_m: f64, from_s: f64, to_m: f64, to_s: f64| {
        while (along_m.len() as f64 * FINE_S) < to_s {
            let share = (along_m.len() as f64 * FINE_S - from_s) / (to_s - from_s);
            along_m.push(from_m + (to_m - from_m) * share);
        }
    };
    for (node, pair) in speeds.windows(2).enumerate() {
        let at_m = node as f64 * STEP_M;
        fill(at_m, until_s, at_m, until_s + waits_s[node]);
        until_s += waits_s[node];
        // Between two nodes at standstill, as where a wait meets the end of the drive, the vehicle
        // creeps.
        let takes_s = 2.0 * STEP_M / (pair[0] + pair[1]).max(CREEP_MPS);
        fill(at_m, until_s, at_m + STEP_M, until_s + takes_s);
        until_s += takes_s;
    }
    let end_m = (speeds.len() - 1) as f64 * STEP_M;
    fill(end_m, until_s, end_m, until_s + waits_s[speeds.len() - 1]);
    along_m
}

/// Every `stride`-th value after the moving averages of [`GRADUAL_S`].
fn gradual(along_m: &[f64], stride: usize) -> Vec<f64> {
    let mut values = along_m.to_vec();
    for span_s in GRADUAL_S {
        let reach = (span_s / FINE_S / 2.0) as usize;
        let mut sums = vec![0.0; values.len() + 1];
        for (i, value) in values.iter().enumerate() {
            sums[i + 1] = sums[i] + value;
        }
        let mean = |i: usize| {
            let reach = reach.min(i).min(values.len() - 1 - i);
            (sums[i + reach + 1] - sums[i - reach]) / (2 * reach + 1) as f64
        };
        values = (0..values.len()).map(mean).collect();
    }
    values.into_iter().step_by(stride).collect()
}
