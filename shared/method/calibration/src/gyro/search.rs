//! The axis and the offset that make the gyro turn as the radar.

use gyre_geometry::samples::UpAxis;

use super::{
    MAX_LATE_S,
    angles::Angles,
    turns::{BASELINE_S, Turn},
};

/// Steps of the offset, s: rates change little meanwhile.
const STEP_S: f64 = 0.25;
/// Peaks that are refined, and parts of a step.
const CANDIDATES: usize = 8;
const FINE: i32 = 20;
/// Offsets within this of the best are of its peak, s.
const PEAK_S: f64 = 3.0;
/// Turns that the log must have in common, and their share of the most that it has at any offset.
/// Among many offsets one of a few turns agrees by chance.
pub(crate) const MIN_TURNS: usize = 36;
const MIN_SHARE: f64 = 0.6;
/// Time after which a turn is independent of another, baselines.
const INDEPENDENT: f64 = 2.0;
/// Least excess of the best offset's log-likelihood over any other's.
const MIN_EVIDENCE: f64 = 5.0;
/// Range of the delays that are searched in a run, s: buffers and stalling hosts cause them.
const MAX_DELAY_S: f64 = 10.0;

/// The axis and the offset that fit best.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Peak {
    pub(crate) delay_s: f64,
    pub(crate) axis: usize,
    /// Of the radar's turns and the angles about the axis.
    pub(crate) correlation: f64,
    turns: usize,
}

impl Peak {
    pub(crate) fn up(&self) -> UpAxis {
        const AXES: [[UpAxis; 2]; 3] = [
            [UpAxis::X, UpAxis::MinusX],
            [UpAxis::Y, UpAxis::MinusY],
            [UpAxis::Z, UpAxis::MinusZ],
        ];
        AXES[self.axis][usize::from(self.correlation < 0.0)]
    }

    /// Returns whether it is about another axis, or farther than a peak is wide.
    fn is_other(&self, peak: &Self) -> bool {
        peak.axis != self.axis || (peak.delay_s - self.delay_s).abs() > PEAK_S
    }

    fn refined(&self, turns: &[Turn], angles: &Angles) -> Self {
        let near = (-FINE..=FINE).map(|k| self.delay_s + STEP_S * f64::from(k) / f64::from(FINE));
        let near = near.map(|delay_s| correlations(turns, angles, delay_s)[self.axis]);
        let covered = near.filter(|peak| 10 * peak.turns >= 9 * self.turns);
        covered
            .max_by(|a, b| a.correlation.abs().total_cmp(&b.correlation.abs()))
            .unwrap_or(*self)
    }

    /// The logarithm of the likelihood ratio of this peak to another, for this number of
    /// independent turns.
    fn evidence(&self, other: &Self, independent: f64) -> f64 {
        let unexplained = |peak: &Self| (1.0 - peak.correlation.powi(2)).max(1e-12);
        0.5 * independent * (unexplained(other) / unexplained(self)).ln()
    }
}

#[derive(Clone, Copy, Debug)]
pub(crate) enum NoPeak {
    Apart {
        turns: usize,
    },
    /// Two offsets or axes fit about as well.
    Ambiguous {
        best: Peak,
        rival: Peak,
    },
}

/// Finds the offset and the axis of the highest correlation.
pub(crate) fn peak(turns: &[Turn], angles: &Angles) -> Result<Peak, NoPeak> {
    let steps = (MAX_LATE_S / STEP_S) as i32;
    let offsets = (-steps..=steps).map(|k| f64::from(k) * STEP_S);
    let mut peaks: Vec<Peak> = offsets
        .flat_map(|delay_s| correlations(turns, angles, delay_s))
        .collect();
    let most = peaks.iter().map(|peak| peak.turns).max().unwrap_or(0);
    if most < MIN_TURNS {
        return Err(NoPeak::Apart { turns: most });
    }
    let enough = MIN_TURNS.max((MIN_SHARE * most as f64) as usize);
    peaks.retain(|peak| peak.turns >= enough);
    peaks.sort_by(|a, b| b.correlation.abs().total_cmp(&a.correlation.abs()));
    let mut highest: Vec<Peak> = Vec::new();
    for peak in peaks {
        if highest.len() < CANDIDATES && highest.iter().all(|it| it.is_other(&peak)) {
            highest.push(peak);
        }
    }
    // Between the steps each may be higher, and a different one the best.
    let mut refined = highest
        .iter()
        .map(|peak| peak.refined(turns, angles))
        .collect::<Vec<_>>();
    refined.sort_by(|a, b| b.correlation.abs().total_cmp(&a.correlation.abs()));
    let best = refined.first().copied().unwrap_or_default();
    let rival = refined.get(1).copied().unwrap_or_default();
    match best.evidence(&rival, independent(turns)) < MIN_EVIDENCE {
        true => Err(NoPeak::Ambiguous { best, rival }),
        false => Ok(best),
    }
}

/// Finds the smallest delay about the axis z that fits about as well as the best one; `None` if
/// that fits hardly better than none at all.
pub(crate) fn nearest(turns: &[Turn], angles: &Angles) -> Option<Peak> {
    let steps = (MAX_DELAY_S / STEP_S) as i32;
    let delays = (-steps..=steps).map(|k| f64::from(k) * STEP_S);
    let peaks = delays.map(|delay_s| correlations(turns, angles, delay_s)[2]);
    let peaks: Vec<Peak> = peaks.filter(|peak| peak.turns >= MIN_TURNS).collect();
    let strength = |peak: &Peak| peak.correlation.abs();
    let best = *peaks
        .iter()
        .max_by(|a, b| strength(a).total_cmp(&strength(b)))?;
    let independent = independent(turns);
    let fits = |peak: &Peak| best.evidence(peak, independent) < MIN_EVIDENCE;
    let fitting = peaks
        .into_iter()
        .filter(|it| it.correlation > 0.0 && fits(it));
    let nearest = fitting.min_by(|a, b| a.delay_s.abs().total_cmp(&b.delay_s.abs()));
    nearest.filter(|_| !fits(&Peak::default()))
}

/// The number of independent turns, each weighted by its angle: a straight road determines nothing,
/// and one bend looks like any other.
fn independent(turns: &[Turn]) -> f64 {
    let count = turns.len() as f64;
    let mean = turns.iter().map(|turn| turn.amount).sum::<f64>() / count;
    let squares = || turns.iter().map(|turn| (turn.amount - mean).powi(2));
    let fourth: f64 = squares().map(|square| square * square).sum();
    let times = turns.windows(2).map(|pair| pair[1].from_s - pair[0].from_s);
    let interval_s = gyre_radar::median(times).unwrap_or_default();
    let turning = squares().sum::<f64>().powi(2) / fourth.max(1e-30);
    turning * (interval_s / (INDEPENDENT * BASELINE_S)).min(1.0)
}

fn correlations(turns: &[Turn], angles: &Angles, delay_s: f64) -> [Peak; 3] {
    let common = turns.iter().filter_map(|turn| {
        let turned = angles.between(turn.from_s + delay_s, turn.to_s + delay_s)?;
        Some((turn.amount, turned.angle))
    });
    let common: Vec<_> = common.collect();
    let count = common.len().max(1) as f64;
    let mean_yaw = common.iter().map(|(yaw, _)| yaw).sum::<f64>() / count;
    [0, 1, 2].map(|axis| {
        let mean = common.iter().map(|(_, angle)| angle[axis]).sum::<f64>() / count;
        let [mut yaws, mut angles, mut products] = [0.0; 3];
        for (yaw, angle) in &common {
            let (yaw, angle) = (yaw - mean_yaw, angle[axis] - mean);
            yaws += yaw * yaw;
            angles += angle * angle;
            products += yaw * angle;
        }
        let correlation = products / (yaws * angles).sqrt();
        Peak {
            delay_s,
            axis,
            // A series that does not turn has no correlation.
            correlation: if correlation.is_finite() {
                correlation
            } else {
                0.0
            },
            turns: common.len(),
        }
    })
}
