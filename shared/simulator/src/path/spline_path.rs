//! A smooth path through poses at discrete times.

use std::f64::consts::{PI, TAU};

use gyre_geometry::Pose;
use gyre_radar::median;
use nalgebra::Vector2;

use super::Path;
use super::spline::{Sample, UniformSpline};

/// Cut-off frequency for measured poses, Hz: faster changes are noise.
const MEASURED_HZ: f64 = 0.7;
/// A vehicle that moves by less than this, metres, for at least [`STAND_S`] is standing.
const STAND_M: f64 = 0.04;
/// The same for its yaw, radians.
const STAND_RAD: f64 = 0.01;
/// Minimum duration of a stand, seconds.
const STAND_S: f64 = 1.5;
/// Weight of the poses of a stand, so that the vehicle does not creep after smoothing.
const STAND_WEIGHT: f64 = 30.0;

/// A path through poses at given times, with derivatives continuous up to the fourth.
#[derive(Clone, Debug)]
pub struct SplinePath {
    curve: UniformSpline<3>,
    duration_s: f64,
}

impl SplinePath {
    /// A path close to `poses`, whose times ascend from zero (seconds), low-pass filtered with
    /// `cutoff_hz`.
    pub fn new(poses: &[(f64, Pose)], cutoff_hz: f64) -> Self {
        Self::smooth(&unwrapped(poses), cutoff_hz)
    }

    /// A path close to measured poses, which have errors of some centimetres. The vehicle stands
    /// where they hardly change for a while.
    pub fn measured(poses: &[(f64, Pose)]) -> Self {
        let mut samples = unwrapped(poses);
        hold_stands(&mut samples);
        Self::smooth(&samples, MEASURED_HZ)
    }

    fn smooth(samples: &[Sample<3>], cutoff_hz: f64) -> Self {
        let duration_s = samples.last().map_or(0.0, |last| last.at);
        let spacing_s = duration_s / (samples.len().max(2) - 1) as f64;
        let step_s = spacing_s.clamp(0.02, 0.5 / cutoff_hz);
        Self {
            curve: UniformSpline::fit(samples, step_s, cutoff_hz),
            duration_s,
        }
    }
}

impl Path for SplinePath {
    fn pose(&self, time_s: f64) -> Pose {
        let [x, y, yaw] = self.curve.value(time_s.clamp(0.0, self.duration_s));
        gyre_geometry::pose(x, y, yaw)
    }

    fn duration_s(&self) -> f64 {
        self.duration_s
    }

    fn velocity(&self, time_s: f64) -> Vector2<f64> {
        if !(0.0..=self.duration_s).contains(&time_s) {
            return Vector2::zeros();
        }
        let [x, y, _] = self.curve.slope(time_s);
        Vector2::new(x, y)
    }
}

/// The poses as x, y and continuous yaw. Its rounding differs from `gyre_geometry::wrap_angle`, and
/// rendered images depend on it.
fn unwrapped(poses: &[(f64, Pose)]) -> Vec<Sample<3>> {
    let mut yaw = 0.0;
    let sample = |(at, pose): &(f64, Pose)| {
        yaw += (pose.rotation.angle() - yaw + PI).rem_euclid(TAU) - PI;
        Sample {
            at: *at,
            value: [pose.translation.x, pose.translation.y, yaw],
            weight: 1.0,
        }
    };
    poses.iter().map(sample).collect()
}

/// Sets all samples of a stand to their median.
fn hold_stands(samples: &mut [Sample<3>]) {
    let mut first = 0;
    while first < samples.len() {
        let origin = samples[first];
        let near = |s: &Sample<3>| {
            let off: [f64; 3] = std::array::from_fn(|d| s.value[d] - origin.value[d]);
            off[0].hypot(off[1]) < STAND_M && off[2].abs() < STAND_RAD
        };
        let count = samples[first..]
            .iter()
            .take_while(|s| near(s))
            .count()
            .max(1);
        let stand = &mut samples[first..first + count];
        if stand[count - 1].at - origin.at < STAND_S {
            first += 1;
            continue;
        }
        let value = std::array::from_fn(|d| {
            median(stand.iter().map(|s| s.value[d])).unwrap_or(origin.value[d])
        });
        for sample in stand {
            *sample = Sample {
                value,
                weight: STAND_WEIGHT,
                ..*sample
            };
        }
        first += count;
    }
}
