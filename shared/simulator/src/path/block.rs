use std::f64::consts::{FRAC_PI_2, TAU};

use gyre_geometry::Pose;

use super::Path;

/// Length of a bend by 90 degrees along the path, metres.
const BEND_M: f64 = 20.0;
/// Share of a bend over which the curvature rises, and over which it falls again: steering takes
/// time.
const RAMP: f64 = 0.25;
/// Braking and acceleration along the path, metres a second squared.
const LONGITUDINAL_MPS2: f64 = 2.5;
/// Distance of the table's nodes along the path, metres.
const STEP_M: f64 = 0.01;

#[derive(Clone, Copy, Debug)]
struct Node {
    time_s: f64,
    x_m: f64,
    y_m: f64,
    heading_rad: f64,
}

/// Laps around a rectangular block, counter-clockwise, slower in the rounded corners. The world's
/// origin is its centre; the path starts in the middle of the side at negative y, towards positive
/// x.
#[derive(Clone, Debug)]
pub struct BlockLoop {
    nodes: Vec<Node>,
    lap_s: f64,
    lap_m: f64,
}

impl BlockLoop {
    /// A loop along the centre lines of four streets: `length_m` along x by `width_m` along y, each
    /// at least 30 m.
    pub fn new(
        length_m: f64,
        width_m: f64,
        speed_mps: f64,
        lateral_acceleration_mps2: f64,
    ) -> Self {
        let footprint = bend_footprint();
        let straights = [length_m - 2.0 * footprint, width_m - 2.0 * footprint].map(|s| s.max(0.0));
        let lap_m = 2.0 * (straights[0] + straights[1]) + 4.0 * BEND_M;
        let count = (lap_m / STEP_M).ceil() as usize;
        let step = lap_m / count as f64;
        let headings: Vec<f64> = (0..=count)
            .map(|i| heading_at(i as f64 * step, &straights))
            .collect();
        let speeds = speeds(&headings, step, speed_mps, lateral_acceleration_mps2);
        let nodes = integrate(&headings, &speeds, step, -width_m / 2.0);
        let lap_s = nodes[count].time_s;
        Self {
            nodes,
            lap_s,
            lap_m,
        }
    }

    pub fn lap_m(&self) -> f64 {
        self.lap_m
    }
}

impl Path for BlockLoop {
    fn lap_s(&self) -> Option<f64> {
        Some(self.lap_s)
    }

    fn pose(&self, time_s: f64) -> Pose {
        let time = time_s.rem_euclid(self.lap_s);
        let next = self
            .nodes
            .partition_point(|node| node.time_s <= time)
            .clamp(1, self.nodes.len() - 1);
        let (a, b) = (self.nodes[next - 1], self.nodes[next]);
        let share = (time - a.time_s) / (b.time_s - a.time_s);
        let between = |from: f64, to: f64| from + share * (to - from);
        gyre_geometry::pose(
            between(a.x_m, b.x_m),
            between(a.y_m, b.y_m),
            between(a.heading_rad, b.heading_rad),
        )
    }
}

/// Heading gained after `share` of a bend: the integral of a trapezoidal curvature, from 0 to 90
/// degrees.
fn bend_heading(share: f64) -> f64 {
    let rising = |u: f64| u * u / (2.0 * RAMP);
    let area = 1.0 - RAMP;
    let gained = if share < RAMP {
        rising(share)
    } else if share > 1.0 - RAMP {
        area - rising(1.0 - share)
    } else {
        share - RAMP / 2.0
    };
    FRAC_PI_2 * gained / area
}

/// Distance from a corner to the start of its bend, metres.
fn bend_footprint() -> f64 {
    let count = (BEND_M / STEP_M) as usize;
    let step = BEND_M / count as f64;
    (0..count)
        .map(|i| step * bend_heading((i as f64 + 0.5) / count as f64).cos())
        .sum()
}

/// Heading after `distance_m` of a lap: half a straight, bend, straight, bend, ..., half a
/// straight.
fn heading_at(distance_m: f64, straights_m: &[f64; 2]) -> f64 {
    let mut left = distance_m - straights_m[0] / 2.0;
    for corner in 0..4 {
        if left <= 0.0 {
            return f64::from(corner) * FRAC_PI_2;
        }
        if left < BEND_M {
            return f64::from(corner) * FRAC_PI_2 + bend_heading(left / BEND_M);
        }
        left -= BEND_M + straights_m[(corner as usize + 1) % 2];
    }
    TAU
}

/// Speed at each node: as fast as bends, braking and acceleration allow, the same in each lap.
fn speeds(headings: &[f64], step: f64, cruise: f64, lateral: f64) -> Vec<f64> {
    let limit = |pair: &[f64]| cruise.min((lateral * step / (pair[1] - pair[0]).max(1e-12)).sqrt());
    let mut speeds: Vec<f64> = headings.windows(2).map(limit).collect();
    let count = speeds.len();
    let reach = |from: f64| (from * from + 2.0 * LONGITUDINAL_MPS2 * step).sqrt();
    for i in 0..2 * count {
        let (here, next) = (i % count, (i + 1) % count);
        speeds[next] = speeds[next].min(reach(speeds[here]));
    }
    for i in (0..2 * count).rev() {
        let (here, next) = (i % count, (i + 1) % count);
        speeds[here] = speeds[here].min(reach(speeds[next]));
    }
    speeds
}

fn integrate(headings: &[f64], speeds: &[f64], step: f64, start_y_m: f64) -> Vec<Node> {
    let mut node = Node {
        time_s: 0.0,
        x_m: 0.0,
        y_m: start_y_m,
        heading_rad: headings[0],
    };
    let mut nodes = vec![node];
    for (pair, speed) in headings.windows(2).zip(speeds) {
        let middle = 0.5 * (pair[0] + pair[1]);
        node.time_s += step / speed;
        node.x_m += step * middle.cos();
        node.y_m += step * middle.sin();
        node.heading_rad = pair[1];
        nodes.push(node);
    }
    nodes
}

#[cfg(test)]
mod tests {
    use super::*;

    fn default_loop() -> BlockLoop {
        BlockLoop::new(48.0, 34.0, 9.5, 5.0)
    }

    #[test]
    fn pose_moves_along_its_heading_and_never_jumps() {
        let path = default_loop();
        for i in 0..3000 {
            let time = f64::from(i) * 0.01;
            let motion = path.pose(time).inverse() * path.pose(time + 0.01);
            assert!(
                motion.translation.x > 0.04 && motion.translation.x < 0.0951,
                "{time}: {motion}"
            );
            assert!(motion.translation.y.abs() < 1e-3, "{time}: {motion}");
            assert!(
                motion.rotation.angle() > -1e-9 && motion.rotation.angle() < 0.01,
                "{time}: {motion}"
            );
        }
    }

    #[test]
    fn bends_respect_the_lateral_acceleration() {
        let path = default_loop();
        for pair in path.nodes.windows(2) {
            let dt = pair[1].time_s - pair[0].time_s;
            let speed = (pair[1].x_m - pair[0].x_m).hypot(pair[1].y_m - pair[0].y_m) / dt;
            let yaw_rate = (pair[1].heading_rad - pair[0].heading_rad) / dt;
            assert!(speed * yaw_rate < 5.01, "{} m/s2", speed * yaw_rate);
        }
    }
}
