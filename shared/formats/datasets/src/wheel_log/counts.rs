//! Logs that count: the ticks of an encoder, or the metres of an odometer, since some time.

use std::path::Path;

use csv::StringRecord;
use gyre_samples::{Sample, SampleKind};

use super::SPEEDS;
use crate::{
    LogError, LogFaults,
    gyro_log::{
        Raw, SampleColumns,
        faults::{ABSURD_SHARE, Plausible, examine},
    },
    header::{Header, Stamp},
    table::Columns,
};

/// Shortest time over which a speed is that of two counts: over less, ticks are too coarse.
const SPAN_NS: i64 = 90_000_000;

/// Names of the ticks of one wheel, or of an axle.
const TICKS: [&str; 4] = ["ticks", "pulses", "wheel_ticks", "encoder_ticks"];
/// Those of two wheels of an axle, whose mean counts.
const LEFT_AND_RIGHT: [[&str; 2]; 3] = [
    ["left_ticks", "right_ticks"],
    ["ticks_left", "ticks_right"],
    ["left_count", "right_count"],
];
/// Names of the metres.
const METRES: [&str; 3] = ["distance_m", "odometer_m", "mileage_m"];

/// Any count: what is plausible are the speeds.
const COUNTS: Plausible = Plausible {
    of: SampleKind::Wheels,
    values: 1,
    most: f64::MAX,
    beyond: "",
};

/// Where a table has counts. A sample of it has the count in the place of the speed.
pub(super) struct CountColumns {
    stamp: Stamp,
    /// One, or one of each wheel.
    counts: Vec<usize>,
    is_in_ticks: bool,
}

impl Columns for CountColumns {
    type Entry = Sample;

    fn by_names(header: &Header) -> Result<Self, String> {
        let one = |all: &[&str]| all.iter().find_map(|name| Some(vec![header.find(name)?]));
        let both = || {
            let mut pairs = LEFT_AND_RIGHT.iter();
            pairs.find_map(|[left, right]| Some(vec![header.find(left)?, header.find(right)?]))
        };
        let metres = one(&METRES);
        let is_in_ticks = metres.is_none();
        let counts = metres.or_else(both).or_else(|| one(&TICKS));
        Ok(Self {
            stamp: header.stamp().ok_or("it has no stamps")?,
            counts: counts.ok_or("it counts nothing")?,
            is_in_ticks,
        })
    }

    fn entry(&self, row: &StringRecord) -> Option<Sample> {
        let mut sum = 0.0;
        for column in &self.counts {
            sum += row.get(*column)?.parse::<f64>().ok()?;
        }
        let count = sum / self.counts.len() as f64;
        Some(Sample::speed(self.stamp.ns(row)?, count))
    }
}

impl SampleColumns for CountColumns {
    const OF: SampleKind = SampleKind::Wheels;

    fn unit_is_assumed(&self) -> bool {
        self.is_in_ticks
    }
}

/// Makes speeds of counts: each is the mean of the time between two, and has the stamp of its
/// middle. Speeds that no vehicle has, as where a counter starts anew, are left out.
///
/// # Errors
/// Ticks whose length is not given, stamps that cannot be those of a sensor, and speeds of which
/// many are those of no vehicle.
pub(super) fn speeds(
    mut raw: Raw,
    path: &Path,
    m_per_tick: Option<f64>,
) -> Result<(Vec<Sample>, LogFaults), LogError> {
    let unusable = |reason: String| LogError::Unusable {
        of: SampleKind::Wheels,
        path: path.to_owned(),
        reason,
    };
    let is_in_ticks = std::mem::take(&mut raw.unit_is_assumed);
    let m_per_count = match is_in_ticks {
        true => m_per_tick.ok_or_else(|| {
            let missing =
                "it counts ticks: give the distance of one, in metres, as wheels.m_per_tick";
            unusable(missing.to_owned())
        })?,
        false => 1.0,
    };
    let (counts, mut faults) = examine(raw, path, &COUNTS)?;
    let mut speeds = Vec::with_capacity(counts.len());
    let mut from = counts[0];
    for to in &counts {
        let span_ns = to.stamp_ns - from.stamp_ns;
        if span_ns >= SPAN_NS {
            let way_m = (to.values[0] - from.values[0]) * m_per_count;
            let speed_mps = way_m / (span_ns as f64 * 1e-9);
            speeds.push(Sample::speed(from.stamp_ns + span_ns / 2, speed_mps));
            from = *to;
        }
    }
    let before = speeds.len();
    if before == 0 {
        return Err(unusable("it is shorter than 0.09 s".to_owned()));
    }
    speeds.retain(|speed| speed.values[0].abs() <= SPEEDS.most);
    let absurd = before - speeds.len();
    if absurd as f64 > ABSURD_SHARE * before as f64 && absurd > 1 || speeds.is_empty() {
        let remedy = match is_in_ticks {
            true => {
                "is wheels.m_per_tick in metres, and does the counter not start anew at each turn?"
            }
            false => "is the distance in metres?",
        };
        return Err(unusable(format!(
            "{absurd} of its {before} speeds are beyond 100 m/s: {remedy}"
        )));
    }
    faults.absurd += absurd;
    Ok((speeds, faults))
}
