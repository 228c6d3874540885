//! The axis and the offset that make the log of a sensor move as the radar.

use gyre_geometry::samples::UpAxis;

use super::{
    ClockError, Kind,
    log::{BASELINE_S, Log, Stretch},
};

/// Offsets of the clocks that are looked at, s: UTC and GPS time are 18 s apart, UTC and TAI 37 s,
/// and the two clocks of a recording of RADIATE 64 s.
pub(super) const MAX_LATE_S: f64 = 120.0;
/// Range of the delays that are searched in a run, s: buffers and stalling hosts cause them.
const MAX_DELAY_S: f64 = 10.0;
/// Steps of the offset, s: rates change little meanwhile.
const STEP_S: f64 = 0.25;
/// Peaks that are refined, and parts of a step.
const CANDIDATES: usize = 8;
const FINE: i32 = 20;
/// Offsets within this of the best are of its peak, s.
const PEAK_S: f64 = 3.0;
/// Stretches that the log must have in common, and their share of the most that it has at any
/// offset. Among many offsets one of a few stretches agrees by chance.
const MIN_STRETCHES: usize = 36;
const MIN_SHARE: f64 = 0.6;
/// Time after which a stretch is independent of another, baselines.
const INDEPENDENT: f64 = 2.0;
/// Least excess of the best offset's log-likelihood over any other's.
const MIN_EVIDENCE: f64 = 5.0;

/// The axis and the offset that fit best.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Peak {
    pub(super) delay_s: f64,
    pub(super) axis: usize,
    /// Of the radar's amounts and the logged ones of the axis.
    pub(super) correlation: f64,
    count: usize,
}

impl Peak {
    pub(super) fn up(&self) -> UpAxis {
        const AXES: [[UpAxis; 2]; 3] = [
            [UpAxis::X, UpAxis::MinusX],
            [UpAxis::Y, UpAxis::MinusY],
            [UpAxis::Z, UpAxis::MinusZ],
        ];
        AXES[self.axis][usize::from(self.correlation < 0.0)]
    }

    fn strength(&self) -> f64 {
        self.correlation.abs()
    }

    /// Returns whether it is about another axis, or farther than a peak is wide.
    fn is_other(&self, peak: &Self) -> bool {
        peak.axis != self.axis || (peak.delay_s - self.delay_s).abs() > PEAK_S
    }
}

fn strongest_first(mut peaks: Vec<Peak>) -> Vec<Peak> {
    peaks.sort_by(|a, b| b.strength().total_cmp(&a.strength()));
    peaks
}

/// The search over all offsets of the clock of a log, and over its axes.
pub(super) struct Search<'a> {
    stretches: &'a [Stretch],
    log: &'a Log,
    axes: usize,
    /// The number of independent stretches.
    independent: f64,
}

impl<'a> Search<'a> {
    pub(super) fn new(stretches: &'a [Stretch], log: &'a Log, axes: usize) -> Self {
        Self {
            stretches,
            log,
            axes,
            independent: independent(stretches),
        }
    }

    /// Finds the offset and the axis of the highest correlation, if no others fit about as well.
    pub(super) fn best(&self, kind: &Kind) -> Result<Peak, ClockError> {
        let mut peaks = self.within(MAX_LATE_S);
        let most = peaks.iter().map(|peak| peak.count).max().unwrap_or(0);
        if most < MIN_STRETCHES {
            return Err(ClockError(format!(
                "with offsets of the clocks up to {MAX_LATE_S:.0} s the log covers {most} {} of a second, and {MIN_STRETCHES} are needed: {}",
                kind.compared,
                (kind.apart)(self.log.begins_s())
            )));
        }
        let enough = MIN_STRETCHES.max((MIN_SHARE * most as f64) as usize);
        peaks.retain(|peak| peak.count >= enough);
        let mut highest: Vec<Peak> = Vec::new();
        for peak in strongest_first(peaks) {
            if highest.len() < CANDIDATES && highest.iter().all(|it| it.is_other(&peak)) {
                highest.push(peak);
            }
        }
        // Between the steps each may be higher, and a different one the best.
        let refined = highest.iter().map(|peak| self.refined(peak));
        let refined = strongest_first(refined.collect());
        let best = refined.first().copied().unwrap_or_default();
        let rival = refined.get(1).copied().unwrap_or_default();
        match self.evidence(&best, &rival) < MIN_EVIDENCE {
            true => Err(ClockError((kind.ambiguous)(&best, &rival))),
            false => Ok(best),
        }
    }

    /// Finds the smallest delay that fits about as well as the best one, with an axis of the same
    /// sign; `None` if that fits hardly better than none at all.
    pub(super) fn nearest(&self) -> Option<Peak> {
        let mut peaks = self.within(MAX_DELAY_S);
        peaks.retain(|peak| peak.count >= MIN_STRETCHES);
        let strength = |a: &&Peak, b: &&Peak| a.strength().total_cmp(&b.strength());
        let best = *peaks.iter().max_by(strength)?;
        let fits = |peak: &Peak| self.evidence(&best, peak) < MIN_EVIDENCE;
        let fitting = peaks
            .into_iter()
            .filter(|it| it.correlation > 0.0 && fits(it));
        let nearest = fitting.min_by(|a, b| a.delay_s.abs().total_cmp(&b.delay_s.abs()));
        nearest.filter(|_| !fits(&Peak::default()))
    }

    fn within(&self, range_s: f64) -> Vec<Peak> {
        let steps = (range_s / STEP_S) as i32;
        let offsets = (-steps..=steps).map(|k| f64::from(k) * STEP_S);
        offsets.flat_map(|delay_s| self.at(delay_s)).collect()
    }

    fn refined(&self, peak: &Peak) -> Peak {
        let near = (-FINE..=FINE).map(|k| peak.delay_s + STEP_S * f64::from(k) / f64::from(FINE));
        let near = near.map(|delay_s| self.at(delay_s)[peak.axis]);
        let covered = near.filter(|it| 10 * it.count >= 9 * peak.count);
        covered
            .max_by(|a, b| a.strength().total_cmp(&b.strength()))
            .unwrap_or(*peak)
    }

    /// The logarithm of the likelihood ratio of one peak to another.
    fn evidence(&self, one: &Peak, other: &Peak) -> f64 {
        let unexplained = |peak: &Peak| (1.0 - peak.correlation.powi(2)).max(1e-12);
        0.5 * self.independent * (unexplained(other) / unexplained(one)).ln()
    }

    /// The correlation about each axis with this delay.
    fn at(&self, delay_s: f64) -> Vec<Peak> {
        let common = self.stretches.iter().filter_map(|stretch| {
            let logged = self.log.over(stretch, delay_s)?;
            Some((stretch.amount, logged.amount))
        });
        let common: Vec<_> = common.collect();
        let count = common.len().max(1) as f64;
        let mean_seen = common.iter().map(|(seen, _)| seen).sum::<f64>() / count;
        let of_axis = |axis: usize| {
            let mean = common.iter().map(|(_, logged)| logged[axis]).sum::<f64>() / count;
            let [mut squares, mut logged_squares, mut products] = [0.0; 3];
            for (seen, logged) in &common {
                let (seen, logged) = (seen - mean_seen, logged[axis] - mean);
                squares += seen * seen;
                logged_squares += logged * logged;
                products += seen * logged;
            }
            let correlation = products / (squares * logged_squares).sqrt();
            Peak {
                delay_s,
                axis,
                // A series that does not change has no correlation.
                correlation: Some(correlation).filter(|it| it.is_finite()).unwrap_or(0.0),
                count: common.len(),
            }
        };
        (0..self.axes).map(of_axis).collect()
    }
}

/// The number of independent stretches, each weighted by its amount: a straight road determines
/// nothing, and one bend looks like any other.
fn independent(stretches: &[Stretch]) -> f64 {
    let count = stretches.len() as f64;
    let mean = stretches.iter().map(|it| it.amount).sum::<f64>() / count;
    let squares = || stretches.iter().map(|it| (it.amount - mean).powi(2));
    let fourth: f64 = squares().map(|square| square * square).sum();
    let times = stretches
        .windows(2)
        .map(|pair| pair[1].from_s - pair[0].from_s);
    let interval_s = gyre_radar::median(times).unwrap_or_default();
    let varying = squares().sum::<f64>().powi(2) / fourth.max(1e-30);
    varying * (interval_s / (INDEPENDENT * BASELINE_S)).min(1.0)
}
