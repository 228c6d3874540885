//! The time offset between two trajectories, by their speeds and turns.

use serde::Serialize;

use crate::trajectory::Trajectory;

/// Offsets that are tried, to both sides, and their distance, ns.
const REACH_NS: i64 = 10_000_000_000;
const STEP_NS: i64 = 50_000_000;
/// Motions are compared over about this long: longer than a scan, so that the noise of single positions averages out, ns.
const BASELINE_NS: i64 = 1_000_000_000;
/// Fewest motions, and the least share of them, that must be within both trajectories for an offset to count.
const FEWEST: usize = 12;
const LEAST_SHARE: f64 = 0.6;
/// An offset below this is no disagreement, s.
const AGREES_S: f64 = 0.15;
/// Correlation of speeds and turns below which nothing can be said.
const CONVINCING: f64 = 0.6;

/// How far a trajectory's clock is from another's.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct ClockOffset {
    /// How late it is, s: what the other does at `t` it does at `t + late_s`.
    pub late_s: f64,
    /// Correlation of the speeds at that offset.
    pub speed_correlation: f64,
    /// Correlation of the yaw rates; `None` where one has no headings.
    pub turn_correlation: Option<f64>,
    /// Whether it turns left where the other turns right.
    pub mirrored: bool,
}

impl ClockOffset {
    /// Whether motions are alike enough for the offset to mean something.
    pub fn is_convincing(&self) -> bool {
        let turns = self.turn_correlation.map(f64::abs);
        turns.map_or(self.speed_correlation, |t| t.max(self.speed_correlation)) >= CONVINCING
    }

    /// Whether both clocks agree.
    pub fn agrees(&self) -> bool {
        self.is_convincing() && self.late_s.abs() <= AGREES_S
    }
}

/// A motion of the reference: when, how far, how much it turned.
struct Motion {
    from_ns: i64,
    to_ns: i64,
    distance_m: f64,
    turn_rad: f64,
}

/// The offset of `other` at which its speeds and turns follow `reference`'s best; `None` where they hardly overlap.
pub(super) fn offset(reference: &Trajectory, other: &Trajectory) -> Option<ClockOffset> {
    let motions = motions(reference);
    let turns = reference.has_heading() && other.has_heading();
    let steps = REACH_NS / STEP_NS;
    let tried: Vec<Option<Fit>> = (-steps..=steps)
        .map(|k| fit(&motions, other, k * STEP_NS, turns))
        .collect();
    let most = tried.iter().flatten().map(|f| f.count).max()?;
    let enough = |f: &Fit| f.count >= FEWEST && f.count as f64 >= LEAST_SHARE * most as f64;
    let score = |k: usize| {
        tried
            .get(k)
            .and_then(Option::as_ref)
            .filter(|f| enough(f))
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
        mirrored: found.turn.is_some_and(|t| t < -CONVINCING),
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

/// How well the other trajectory follows at one offset.
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

/// Pearson's correlation, from running sums.
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

    /// 0 where one of both does not vary.
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

    /// A drive of varying speed and turns, seen `late_ns` late.
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
            assert!(found.is_convincing() && !found.mirrored);
            assert_eq!(found.agrees(), late_ms.abs() < 150);
        }
    }

    #[test]
    fn a_mirrored_truth_is_told() {
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
