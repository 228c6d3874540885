use gyre_geometry::samples::Sample;
use gyre_radar::median;
use nalgebra::Vector3;

/// The integrals of the three rates of a log, s since the first scan on the log's own clock.
pub(crate) struct Angles {
    stamps_s: Vec<f64>,
    rates: Vec<Vector3<f64>>,
    /// Angles since the first sample, and gaps.
    angles: Vec<Vector3<f64>>,
    gaps: Vec<usize>,
}

#[derive(Clone, Copy, Debug)]
pub(crate) struct Turned {
    /// Angles about x, y and z, rad.
    pub(crate) angle: Vector3<f64>,
    /// The rates at the end less those at the start, rad/s: the change of the angles by a later
    /// time.
    pub(crate) by_late: Vector3<f64>,
}

impl Angles {
    pub(crate) fn new(samples: &[Sample], first_ns: i64, max_gap_s: f64) -> Self {
        let samples = samples.iter();
        let seconds = |ns: i64| (i128::from(ns) - i128::from(first_ns)) as f64 * 1e-9;
        let stamps_s: Vec<f64> = samples.clone().map(|it| seconds(it.stamp_ns)).collect();
        let rates: Vec<_> = samples
            .map(|it| Vector3::new(it.values[0], it.values[1], it.values[2]))
            .collect();
        let (mut angle, mut gap) = (Vector3::zeros(), 0);
        let (mut angles, mut gaps) = (vec![angle], vec![gap]);
        for k in 1..rates.len() {
            let step_s = stamps_s[k] - stamps_s[k - 1];
            angle += 0.5 * step_s * (rates[k] + rates[k - 1]);
            gap += usize::from(step_s > max_gap_s);
            angles.push(angle);
            gaps.push(gap);
        }
        Self {
            stamps_s,
            rates,
            angles,
            gaps,
        }
    }

    /// Returns the median time between samples, s.
    pub(crate) fn period_s(&self) -> f64 {
        let steps = self.stamps_s.windows(2).map(|pair| pair[1] - pair[0]);
        median(steps).unwrap_or_default()
    }

    pub(crate) fn begins_s(&self) -> Option<f64> {
        self.stamps_s.first().copied()
    }

    /// Integrates over a time of the log's clock; `None` where samples are missing.
    pub(crate) fn between(&self, from_s: f64, to_s: f64) -> Option<Turned> {
        let [(first, from), (last, to)] = [self.at(from_s)?, self.at(to_s)?];
        let has_gap = self.gaps[last + 1] > self.gaps[first];
        (!has_gap).then(|| Turned {
            angle: to.angle - from.angle,
            by_late: to.by_late - from.by_late,
        })
    }

    /// The sample before a time, with the angle and the rate at it; `None` outside of the log.
    fn at(&self, time_s: f64) -> Option<(usize, Turned)> {
        let after = self.stamps_s.partition_point(|stamp_s| *stamp_s <= time_s);
        let before = after.checked_sub(1)?;
        let next_s = self.stamps_s.get(after)?;
        let since_s = time_s - self.stamps_s[before];
        let share = since_s / (next_s - self.stamps_s[before]);
        let rate = self.rates[before].lerp(&self.rates[after], share);
        let turned = Turned {
            angle: self.angles[before] + 0.5 * since_s * (self.rates[before] + rate),
            by_late: rate,
        };
        Some((before, turned))
    }
}
