//! Time offset between two trajectories, from their speeds and yaw rates.

use serde::Serialize;

use crate::trajectory::Trajectory;

/// Range and step of the offsets that are evaluated, ns.
const MAX_OFFSET_NS: i64 = 10_000_000_000;
const STEP_NS: i64 = 50_000_000;
/// Duration of the motions that are compared, ns: longer than a scan, to average the noise of
/// positions.
const BASELINE_NS: i64 = 1_000_000_000;
/// Minimum number and share of motions within both trajectories for an offset to be considered.
const MIN_MOTIONS: usize = 12;
const MIN_SHARE: f64 = 0.6;
/// Maximum offset of clocks that agree, s.
const MAX_AGREEING_S: f64 = 0.15;
/// Minimum correlation of speeds or yaw rates for a reliable offset.
const MIN_CORRELATION: f64 = 0.6;

/// Offset between the clocks of two trajectories.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct ClockOffset {
    /// Delay, s: the motion of the reference at `t` is that of the other trajectory at
    /// `t + late_s`.
    pub late_s: f64,
    /// Correlation of the speeds at that offset.
    pub speed_correlation: f64,
    /// Correlation of the yaw rates at that offset; `None` if a trajectory has no headings.
    pub turn_correlation: Option<f64>,
    /// True if the trajectories turn in opposite directions.
    pub mirrored: bool,
}

impl ClockOffset {
    /// Returns whether the correlation is high enough for the offset to be reliable.
    pub fn is_reliable(&self) -> bool {
        let turns = self.turn_correlation.map(f64::abs);
        turns.map_or(self.speed_correlation, |t| t.max(self.speed_correlation)) >= MIN_CORRELATION
    }

    /// Returns whether the clocks agree.
    pub fn agrees(&self) -> bool {
        self.is_reliable() && self.late_s.abs() <= MAX_AGREEING_S
    }
}

/// A motion of the reference.
struct Motion {
    from_ns: i64,
    to_ns: i64,
    distance_m: f64,
    turn_rad: f64,
}

/// Returns the offset of `other` with the highest correlation of speeds and yaw rates; `None`
/// without sufficient overlap.
pub(super) fn offset(reference: &Trajectory, other: &Trajectory) -> Option<ClockOffset> {
    let motions = motions(reference);
    let turns = reference.has_heading() && other.has_heading();
    let steps = MAX_OFFSET_NS / STEP_NS;
    let tried: Vec<Option<Fit>> = (-steps..=steps)
        .map(|k| fit(&motions, other, k * STEP_NS, turns))
        .collect();
    let max_count = tried.iter().flatten().map(|f| f.count).max()?;
    let is_sufficient =
        |f: &Fit| f.count >= MIN_MOTIONS && f.count as f64 >= MIN_SHARE * max_count as f64;
    let score = |k: usize| {
        tried
            .get(k)
            .and_then(Option::as_ref)
            .filter(|f| is_sufficient(f))
            .map(Fit::score)
    };
    let best = (0..tried.len())
        .filter(|k| score(*k).is_some())
        .max_by(|a, b| {
            score(*a)
                .partial_cmp(&score(*b))
                .unwrap_or(std::cmp::Ordering::Equal)
        })?;
    let fine = match (score(best.wrapping_sub(1)), score(best), score(best + 1)) {
        (Some(a), Some(b), Some(c)) if a - 2.0 * b + c < 0.0 => 0.5 * (a - c) / (a - 2.0 * b + c),
        _ => 0.0,
    };
    let found = tried[best].as_ref()?;
    Some(ClockOffset {
        late_s: (best as f64 - steps as f64 + fine) * STEP_NS as f64 * 1e-9,
        speed_correlation: found.speed,
        turn_correlation: found.turn,
        mirrored: found.turn.is_some_and(|t| t < -MIN_CORRELATION),
    })
}

fn motions(reference: &Trajectory) -> Vec<Motion> {
    let Some(stamps) = &reference.stamp_ns else {
        return Vec::new();
    };
    let over_baseline = |i: usize| {
        let j = stamps.partition_point(|s| *s < stamps[i] + BASELINE_NS);
        let (a, b) = (reference.poses.get(i)?, reference.poses.get(j)?);
        let (distance_m, turn_rad) = (
            (b.translation.vector - a.translation.vector).norm(),
            (a.rotation.inverse() * b.rotation).angle(),
        );
        Some(Motion {
            from_ns: stamps[i],
            to_ns: stamps[j],
            distance_m,
            turn_rad,
        })
    };
    (0..stamps.len()).map_while(over_baseline).collect()
}

/// Correlation at one offset.
struct Fit {
    count: usize,
    speed: f64,
    turn: Option<f64>,
}

impl Fit {
    fn score(&self) -> f64 {
        self.speed + self.turn.map_or(0.0, f64::abs)
    }
}

fn fit(motions: &[Motion], other: &Trajectory, late_ns: i64, turns: bool) -> Option<Fit> {
    let (mut speed, mut turn) = (Correlation::default(), Correlation::default());
    for m in motions {
        let Some((a, b)) = other
            .at(m.from_ns + late_ns)
            .zip(other.at(m.to_ns + late_ns))
        else {
            continue;
        };
        let seconds = (m.to_ns - m.from_ns) as f64 * 1e-9;
        speed.add(
            m.distance_m / seconds,
            (b.translation.vector - a.translation.vector).norm() / seconds,
        );
        turn.add(
            m.turn_rad / seconds,
            (a.rotation.inverse() * b.rotation).angle() / seconds,
        );
    }
    (speed.n > 0.0).then(|| Fit {
        count: speed.n as usize,
        speed: speed.value(),
        turn: turns.then(|| turn.value()),
    })
}

/// Pearson correlation, from running sums.
#[derive(Default)]
struct Correlation {
    n: f64,
    sum: (f64, f64),
    squares: (f64, f64),
    products: f64,
}

impl Correlation {
    fn add(&mut self, a: f64, b: f64) {
        self.n += 1.0;
        self.sum = (self.sum.0 + a, self.sum.1 + b);
        self.squares = (self.squares.0 + a * a, self.squares.1 + b * b);
        self.products += a * b;
    }

    /// The coefficient; 0 if a variable is constant.
    fn value(&self) -> f64 {
        let variance = |sum: f64, squares: f64| squares / self.n - (sum / self.n).powi(2);
        let (a, b) = (
            variance(self.sum.0, self.squares.0),
            variance(self.sum.1, self.squares.1),
        );
        let covariance = self.products / self.n - self.sum.0 * self.sum.1 / (self.n * self.n);
        if a <= 1e-12 || b <= 1e-12 {
            0.0
        } else {
            covariance / (a * b).sqrt()
        }
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use gyre_geometry::{Pose, pose};

    /// A drive of varying speed and yaw rate, delayed by `late_ns`.
    fn drive(late_ns: i64, sign: f64) -> Trajectory {
        let (mut now, mut poses, mut stamps) = (Pose::identity(), Vec::new(), Vec::new());
        for k in 0..1200_i64 {
            let t = k as f64 * 0.05;
            stamps.push(1_549_986_607_000_000_000 + k * 50_000_000 + late_ns);
            poses.push(now);
            let speed = 8.0 + 3.0 * (0.37 * t).sin() + 2.0 * (1.1 * t).cos();
            now *= pose(speed * 0.05, 0.0, sign * 0.05 * 0.3 * (0.53 * t).sin());
        }
        Trajectory {
            stamp_ns: Some(stamps),
            poses,
        }
    }

    #[test]
    fn a_late_clock_is_measured() {
        for late_ms in [-3_210, -20, 0, 777, 1_600] {
            let found = offset(&drive(0, 1.0), &drive(late_ms * 1_000_000, 1.0)).unwrap();
            assert!(
                (found.late_s - late_ms as f64 * 1e-3).abs() < 0.01,
                "{late_ms} ms: {found:?}"
            );
            assert!(found.is_reliable() && !found.mirrored);
            assert_eq!(found.agrees(), late_ms.abs() < 150);
        }
    }

    #[test]
    fn a_mirrored_ground_truth_is_detected() {
        let found = offset(&drive(0, 1.0), &drive(500_000_000, -1.0)).unwrap();
        assert!(
            found.mirrored && (found.late_s - 0.5).abs() < 0.01,
            "{found:?}"
        );
    }

    #[test]
    fn trajectories_of_different_days_have_no_offset() {
        assert!(offset(&drive(0, 1.0), &drive(86_400_000_000_000, 1.0)).is_none());
        assert!(offset(&drive(0, 1.0), &Trajectory::default()).is_none());
    }
}
