//! Faults of the samples of a log, and which samples are left out.

mod breaks;
mod bursts;
mod order;

use std::path::Path;

use super::SampleLog;

use gyre_radar::median;
use serde::Serialize;

use crate::{
    LogError,
    table::{Raw, leave_out},
};
use gyre_geometry::samples::{Sample, SampleKind};

/// Rates beyond this one are no vehicle's, rad/s.
const ABSURD_RADPS: f64 = 10.0;
/// If the share of absurd rates is larger, the unit must be different.
pub(crate) const ABSURD_SHARE: f64 = 0.01;
/// Longest time between two samples that is no gap, median periods, whatever stamps round to.
const GAP_PERIODS: f64 = 3.0 + 1e-6;

const SPREAD: &str = "samples come in bursts of one stamp: spread evenly back to the burst before.";
const REPEATED: &str = "samples have the stamp of a different sample: left out.";
const OUT_OF_ORDER: &str = "samples come later than their stamps say: sorted.";
const MEASURED_TWICE: &str = "samples are of times over which the clock was set back, and which have two measurements: left out.";

/// Faults of a log. Its samples do not include the ones counted as left out.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct LogFaults {
    /// Rows that do not fit the table, such as a truncated row: left out.
    pub unreadable: usize,
    /// Line (of a folder of files: number) of the first of them.
    pub first_unreadable: usize,
    /// Samples that are stated to have no value, or have one that is not finite: left out.
    pub not_a_number: usize,
    /// Samples with a rate beyond 10 rad/s, or a speed beyond 100 m/s: left out.
    pub absurd: usize,
    /// Samples that come in bursts of one stamp: spread over the time since the burst before.
    pub spread: usize,
    /// Samples with a repeated stamp: left out.
    pub repeated: usize,
    /// Samples with a stamp before an earlier one: sorted.
    pub out_of_order: usize,
    /// Samples of times for which the clock was set back, by up to a second: left out.
    pub measured_twice: usize,
    /// Places where the stamps step back by more than a second, or ahead by more than an hour, s.
    pub clock_steps_s: Vec<f64>,
    /// The number of the sample, from 1, behind which the first of them is.
    pub first_clock_step: usize,
    /// Samples whose stamps such steps make unusable: left out.
    pub by_clock_steps: usize,
    /// Times without samples, of more than three periods.
    pub gaps: Vec<LogGap>,
    /// Samples that are missing one or two at a time: the value is interpolated.
    pub bridged: usize,
    /// The header names no unit: rad/s or m/s is assumed.
    pub unit_is_assumed: bool,
}

#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct LogGap {
    /// The last sample before it, s since the first of the log.
    pub after_s: f64,
    pub seconds: f64,
}

impl LogFaults {
    /// Returns how the clock steps, and where first: without a full stop.
    pub fn clock_steps(&self) -> String {
        let (count, first) = (self.clock_steps_s.len(), self.first_clock_step);
        let steps = self.clock_steps_s.iter().take(5);
        let steps: Vec<String> = steps.map(|step| format!("{step:+.6} s")).collect();
        let steps = steps.join(", ");
        format!("The clock steps {count} times ({steps}), first behind sample {first}")
    }

    /// Returns a sentence for each kind of fault of the log of a sensor.
    pub fn sentences(&self, of: SampleKind) -> Vec<String> {
        let [values, absurd, unit_of] = match of {
            SampleKind::Gyro => [
                "rates",
                "rates beyond 10 rad/s, at which no vehicle turns",
                "of the rates: rad/s is assumed; `gyre calibrate` tells deg/s by its scale",
            ],
            SampleKind::Wheels => [
                "speeds",
                "speeds beyond 100 m/s, at which no vehicle drives",
                "of the speed: m/s is assumed; `gyre calibrate` tells km/h by its scale",
            ],
        };
        let line = self.first_unreadable;
        let table = format!("rows are not of its table, the first in line {line}: left out.");
        let numbers = format!("samples have no {values}, or some that are not finite: left out.");
        let absurd = format!("samples have {absurd}: left out.");
        let counted = [
            (self.unreadable, table.as_str()),
            (self.not_a_number, numbers.as_str()),
            (self.absurd, absurd.as_str()),
            (self.spread, SPREAD),
            (self.repeated, REPEATED),
            (self.out_of_order, OUT_OF_ORDER),
            (self.measured_twice, MEASURED_TWICE),
        ];
        let counted = counted.into_iter().filter(|(count, _)| *count > 0);
        let counted = counted.map(|(count, sentence)| format!("{count} {sentence}"));
        let steps = (!self.clock_steps_s.is_empty()).then(|| {
            let (steps, count) = (self.clock_steps(), self.by_clock_steps);
            format!("{steps}: {count} samples that do not fit with the others are left out.")
        });
        let longest = self.gaps.iter().copied();
        let longest = longest.max_by(|a, b| a.seconds.total_cmp(&b.seconds));
        let gaps = longest.map(|LogGap { after_s, seconds }| {
            let places = self.gaps.len();
            format!("Samples are missing in {places} places, for up to {seconds:.2} s ({after_s:.1} s after the first).")
        });
        let count = self.bridged;
        let bridged = (count > 0).then(|| {
            format!("{count} samples are missing one or two at a time: interpolated where `max_gap_s` allows it.")
        });
        let unit = format!("The header names no unit {unit_of}.");
        let unit = self.unit_is_assumed.then_some(unit);
        let others = [steps, gaps, bridged, unit].into_iter().flatten();
        counted.chain(others).collect()
    }
}

#[derive(Clone, Copy, Debug)]
pub(crate) struct Plausible {
    pub of: SampleKind,
    /// The number of values of a sample that count.
    pub values: usize,
    pub most: f64,
    /// That in words, and the remedy where many are beyond.
    pub beyond: &'static str,
}

pub(super) const RATES: Plausible = Plausible {
    of: SampleKind::Gyro,
    values: 3,
    most: ABSURD_RADPS,
    beyond: "have rates beyond 10 rad/s, at which no vehicle turns: if they are in deg/s, name the columns so, as gyro_z_degps",
};

pub(crate) fn examine(
    raw: Raw<Sample>,
    unit_is_assumed: bool,
    path: &Path,
    plausible: &Plausible,
) -> Result<SampleLog, LogError> {
    let unusable = |reason: String| LogError::unusable(plausible.of.section(), path, reason);
    let mut faults = LogFaults {
        unreadable: raw.unreadable.count,
        first_unreadable: raw.unreadable.first,
        unit_is_assumed,
        ..LogFaults::default()
    };
    if let Some(reason) = raw.unreadable.are_most(raw.count()) {
        return Err(unusable(reason));
    }
    let mut samples = raw.entries;
    let values = |sample: &Sample| sample.values.into_iter().take(plausible.values);
    let left_out = leave_out(&mut samples, |it| {
        values(it).any(|value| !value.is_finite())
    });
    faults.not_a_number = left_out + raw.unmeasured;
    let (finite, most) = (samples.len(), plausible.most);
    let absurd = leave_out(&mut samples, |it| {
        values(it).any(|value| value.abs() > most)
    });
    faults.absurd = absurd;
    if absurd as f64 > ABSURD_SHARE * finite as f64 {
        let beyond = plausible.beyond;
        return Err(unusable(format!(
            "{absurd} of its {finite} samples {beyond}"
        )));
    }
    bursts::spread(&mut samples, &mut faults);
    let samples = breaks::repair(samples, &mut faults).map_err(unusable)?;
    let samples = order::sort(&samples, &mut faults);
    if samples.is_empty() {
        return Err(unusable("it has no samples".to_owned()));
    }
    (faults.gaps, faults.bridged) = gaps(&samples);
    Ok(SampleLog {
        samples,
        faults,
        path: path.to_owned(),
    })
}

/// Times without samples, of samples in the order of their stamps, and the number of samples that
/// are missing one or two at a time.
fn gaps(samples: &[Sample]) -> (Vec<LogGap>, usize) {
    let seconds = |from: usize, to: usize| {
        let [from, to] = [from, to].map(|k| samples.get(k).map(|it| it.stamp_ns));
        from.zip(to).map(|(from, to)| (to - from) as f64 * 1e-9)
    };
    let steps = || (0..samples.len()).filter_map(|k| Some((k, seconds(k, k + 1)?)));
    let period_s = median(steps().map(|(_, step_s)| step_s)).unwrap_or_default();
    let (gaps, short): (Vec<_>, Vec<_>) = steps().partition(|it| it.1 > GAP_PERIODS * period_s);
    let missing = |(k, step_s): (usize, f64)| {
        let missing = (step_s / period_s - 1.0).round();
        // A stamp that jitters is as much nearer to the sample on its other side.
        let before = k.checked_sub(1).and_then(|before| seconds(before, k + 1));
        let mut around = before.into_iter().chain(seconds(k, k + 2));
        let is_missing = around.all(|around_s| around_s > (missing + 1.5) * period_s);
        if is_missing { missing as usize } else { 0 }
    };
    let bridged = short.into_iter().map(missing).sum();
    let gaps = gaps.into_iter().map(|(k, step_s)| LogGap {
        after_s: seconds(0, k).unwrap_or_default(),
        seconds: step_s,
    });
    (gaps.collect(), bridged)
}
