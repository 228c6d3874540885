//! Time offset between two trajectories, from their speeds and yaw rates.

use std::fmt;

use serde::Serialize;

use crate::trajectory::Trajectory;

/// Range of the offsets that are evaluated, s: UTC and GPS time are 18 s apart, UTC and TAI 37 s.
pub const MAX_OFFSET_S: i64 = 60;
/// An offset farther from zero must fit better by more than so many standard errors: a drive around
/// a block repeats its speeds, and some stretch of a long drive resembles a different one.
const MARGIN_SIGMAS: f64 = 3.0;
const SECOND_NS: i64 = 1_000_000_000;
/// Steps of the offsets, ns: first over the range, then around the best.
const COARSE_NS: i64 = 250_000_000;
const STEP_NS: i64 = 50_000_000;
const MAX_MOTIONS: usize = 2000;
/// Duration of the motions that are compared, ns: longer than a scan, to average the noise of
/// positions.
const BASELINE_NS: i64 = 1_000_000_000;
/// Minimum number and share of motions within both trajectories for an offset to be considered.
/// Among hundreds of offsets one of a dozen motions at constant speed agrees by chance.
const MIN_MOTIONS: usize = 36;
const MIN_SHARE: f64 = 0.6;
const MAX_AGREEING_S: f64 = 0.15;
/// Minimum correlation of speeds or yaw rates for a reliable offset.
const MIN_CORRELATION: f64 = 0.6;

#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct ClockOffset {
    /// Delay, s: the motion of the reference at `t` equals the motion of the other trajectory at `t
    /// + delay_s`.
    pub delay_s: f64,
    pub speed_correlation: f64,
    /// Correlation of the yaw rates at that offset; `None` if a trajectory has no headings.
    pub turn_correlation: Option<f64>,
    pub mirrored: bool,
}

impl ClockOffset {
    pub fn is_reliable(&self) -> bool {
        let turns = self.turn_correlation.map(f64::abs);
        turns.map_or(self.speed_correlation, |t| t.max(self.speed_correlation)) >= MIN_CORRELATION
    }

    pub fn agrees(&self) -> bool {
        self.is_reliable() && self.delay_s.abs() <= MAX_AGREEING_S
    }
}

impl fmt::Display for ClockOffset {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let word = if self.delay_s > 0.0 { "late" } else { "early" };
        write!(f, "{:.2} s {word}", self.delay_s.abs())
    }
}

struct Motion {
    from_ns: i64,
    to_ns: i64,
    distance_m: f64,
    turn_rad: f64,
}

/// Returns the offset of `other` with the highest correlation of speeds and yaw rates; `None`
/// without sufficient overlap, or without times.
pub fn clock_offset(reference: &Trajectory, other: &Trajectory) -> Option<ClockOffset> {
    let motions = motions(reference);
    let turns = reference.has_heading() && other.has_heading();
    let fits = |offsets: Vec<i64>| -> Vec<Fit> {
        let fits = offsets.into_iter();
        fits.filter_map(|late_ns| fit(&motions, other, late_ns, turns))
            .collect()
    };
    let steps = MAX_OFFSET_S * SECOND_NS / COARSE_NS;
    let coarse = fits((-steps..=steps).map(|k| k * COARSE_NS).collect());
    let max_count = coarse.iter().map(|fit| fit.count).max()?;
    let sufficient = |fits: Vec<Fit>| -> Vec<Fit> {
        let enough = |fit: &Fit| {
            fit.count >= MIN_MOTIONS && fit.count as f64 >= MIN_SHARE * max_count as f64
        };
        fits.into_iter().filter(enough).collect()
    };
    let coarse = sufficient(coarse);
    let best = coarse
        .iter()
        .max_by(|a, b| a.score().total_cmp(&b.score()))?;
    let independent = independent(&motions, best.count);
    let is_peak = |k: &usize| {
        let lower = |other: Option<&Fit>| other.is_none_or(|it| it.score() <= coarse[*k].score());
        lower(k.checked_sub(1).and_then(|before| coarse.get(before))) && lower(coarse.get(k + 1))
    };
    let peaks = (0..coarse.len()).filter(is_peak).map(|k| &coarse[k]);
    let around = peaks
        .filter(|peak| best.sigmas_above(peak, independent) <= MARGIN_SIGMAS)
        .map(|peak| peak.late_ns)
        .min_by_key(|late_ns| late_ns.abs())?;
    let steps = COARSE_NS / STEP_NS;
    let fine = sufficient(fits(
        (-steps..=steps).map(|k| around + k * STEP_NS).collect(),
    ));
    let scores: Vec<f64> = fine.iter().map(Fit::score).collect();
    let best = (0..fine.len()).max_by(|a, b| scores[*a].total_cmp(&scores[*b]))?;
    let found = &fine[best];
    Some(ClockOffset {
        delay_s: found.late_ns as f64 * 1e-9 + peak(&scores, best) * STEP_NS as f64 * 1e-9,
        speed_correlation: found.speed,
        turn_correlation: found.turn,
        mirrored: found.turn.is_some_and(|t| t < -MIN_CORRELATION),
    })
}

/// Returns the place of the peak of the parabola through a maximum and its neighbours, in steps
/// from the maximum.
fn peak(scores: &[f64], best: usize) -> f64 {
    let around = best
        .checked_sub(1)
        .and_then(|from| scores.get(from..=best + 1));
    match around {
        Some(&[a, b, c]) if a - 2.0 * b + c < 0.0 => 0.5 * (a - c) / (a - 2.0 * b + c),
        _ => 0.0,
    }
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
    let every = stamps.len().div_ceil(MAX_MOTIONS).max(1);
    let starts = (0..stamps.len()).step_by(every);
    starts.map_while(over_baseline).collect()
}

/// Returns how many of so many motions are independent: those that do not overlap.
fn independent(motions: &[Motion], count: usize) -> f64 {
    let span_ns = match motions {
        [first, .., last] => last.to_ns - first.from_ns,
        _ => 0,
    };
    let apart = span_ns as f64 / BASELINE_NS as f64;
    count as f64 * (apart / motions.len().max(1) as f64).min(1.0)
}

struct Fit {
    late_ns: i64,
    count: usize,
    speed: f64,
    turn: Option<f64>,
}

impl Fit {
    fn score(&self) -> f64 {
        self.speed + self.turn.map_or(0.0, f64::abs)
    }

    /// Returns by how many standard errors this fit is better than a different one, by Fisher's
    /// transformation: atanh(r) of n independent pairs has the variance 1 / (n - 3).
    fn sigmas_above(&self, other: &Self, independent: f64) -> f64 {
        let transformed = |fit: &Self| {
            let all = [Some(fit.speed), fit.turn.map(f64::abs)];
            let terms = all.into_iter().flatten();
            terms.map(|r| r.clamp(-0.9999, 0.9999).atanh()).sum::<f64>()
        };
        let terms = 1.0 + f64::from(u8::from(self.turn.is_some()));
        let variance = terms / (independent - 3.0).max(1.0);
        (transformed(self) - transformed(other)) / variance.sqrt()
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
        late_ns,
        count: speed.n as usize,
        speed: speed.value(),
        turn: turns.then(|| turn.value()),
    })
}

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
        Trajectory::timed(stamps, poses)
    }

    #[test]
    fn a_late_clock_is_measured() {
        for late_ms in [-3_210, -20, 0, 777, 1_600, 18_000, -37_000] {
            let found = clock_offset(&drive(0, 1.0), &drive(late_ms * 1_000_000, 1.0)).unwrap();
            assert!(
                (found.delay_s - late_ms as f64 * 1e-3).abs() < 0.01,
                "{late_ms} ms: {found:?}"
            );
            assert!(found.is_reliable() && !found.mirrored);
            assert_eq!(found.agrees(), late_ms.abs() < 150);
        }
    }

    /// A block is 15 s long, and its two halves are equal: with noise, one of its repetitions fits
    /// best by chance.
    #[test]
    fn a_drive_around_a_block_has_the_offset_nearest_to_zero() {
        for (seed, late_ms) in [(1_u64, 0), (2, 0), (3, 0), (4, 2_000), (5, -2_000)] {
            let mut state = seed;
            let mut noise = || {
                state = state
                    .wrapping_mul(6_364_136_223_846_793_005)
                    .wrapping_add(1);
                (state >> 33) as f64 / f64::from(1_u32 << 31) - 0.5
            };
            let mut block = |late_ms: i64, noise_m: f64| {
                let (mut x, mut poses, mut stamps) = (0.0, Vec::new(), Vec::new());
                for k in 0..240_i64 {
                    stamps.push(1_549_986_607_000_000_000 + k * 250_000_000 + late_ms * 1_000_000);
                    poses.push(Pose::translation(x + noise_m * noise(), 0.0));
                    let turning = (k as f64 * 0.25 / 7.5).fract() < 0.4;
                    x += 0.25 * if turning { 4.0 } else { 9.5 };
                }
                Trajectory::timed(stamps, poses)
            };
            let found = clock_offset(&block(0, 3.0), &block(late_ms, 0.0)).unwrap();
            assert!(
                (found.delay_s - late_ms as f64 * 1e-3).abs() < 0.3,
                "{late_ms} ms: {found:?}"
            );
        }
    }

    #[test]
    fn a_mirrored_ground_truth_is_detected() {
        let found = clock_offset(&drive(0, 1.0), &drive(500_000_000, -1.0)).unwrap();
        assert!(
            found.mirrored && (found.delay_s - 0.5).abs() < 0.01,
            "{found:?}"
        );
    }

    #[test]
    fn trajectories_of_different_days_have_no_offset() {
        assert!(clock_offset(&drive(0, 1.0), &drive(86_400_000_000_000, 1.0)).is_none());
        assert!(clock_offset(&drive(0, 1.0), &Trajectory::default()).is_none());
    }
}
