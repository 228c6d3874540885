//! The log of the wheels as a file: a table as CSV, of speeds, or of an encoder or an odometer that
//! counts ticks or metres since some time.

use std::path::{Path, PathBuf};

use csv::StringRecord;
use gyre_geometry::samples::{Sample, SampleKind};
use gyre_radar::median;

use crate::{
    LogError, SampleLog,
    gyro_log::faults::{ABSURD_SHARE, Plausible, examine},
    header::{Header, Stamp, unit_of},
    logs,
    table::{Columns, Raw, Rows},
};

const OF: &str = SampleKind::Wheels.section();

/// Logs relative to the root of a dataset, in order of precedence.
const PLACES: [&str; 4] = ["wheels.csv", "wheel_speed.csv", "speed.csv", "odometer.csv"];

const SPEEDS: Plausible = Plausible {
    of: SampleKind::Wheels,
    values: 1,
    most: 100.0,
    beyond: "have speeds beyond 100 m/s: if they are in km/h, name the column so, as speed_km_h",
};

impl SampleLog {
    /// Reads the log of the wheels. Its first row names the columns, as in `stamp_ns,speed_m_s`, or
    /// in `stamp_ns,ticks` for ticks of `m_per_tick` metres.
    pub fn read_wheels(path: &Path, m_per_tick: Option<f64>) -> Result<Self, LogError> {
        let no_speed = match logs::rows::<SpeedColumns>(path, OF) {
            Ok(rows) => return examine(rows.raw, rows.columns.unit.is_none(), path, &SPEEDS),
            Err(error) => error,
        };
        match logs::rows::<CountColumns>(path, OF) {
            Ok(rows) => speeds(rows, path, m_per_tick),
            Err(_) => Err(no_speed),
        }
    }

    /// Returns the log beside the scans of a dataset folder, which may also be the folder of the
    /// images.
    pub fn find_wheels(folder: &Path) -> Result<PathBuf, LogError> {
        logs::find(folder, OF, &PLACES)
    }

    /// Takes the samples of wheels in a bag or a simulation, which messages name by this path.
    pub fn of_wheels(samples: Vec<Sample>, path: &Path) -> Result<Self, LogError> {
        examine(Raw::of(samples), false, path, &SPEEDS)
    }
}

const NAMES: &str = "speed wheel_speed vehicle_speed velocity v vx linear_x";
const UNITS: [(&str, f64); 3] = [
    ("_mps _m_s _m_per_s", 1.0),
    ("_kmh _km_h _kmph _kph", 1.0 / 3.6),
    ("_mph", 0.44704),
];

const REMEDY: &str = "the first row must name the columns, as in `stamp_ns,speed_m_s` (also stamp_us, stamp_s; speed_km_h; ticks, distance_m)";

/// Columns with the direction of a speed that has no sign.
const DIRECTIONS: &str =
    "direction driving_direction travel_direction reverse is_reverse reversing";

struct SpeedColumns {
    stamp: Stamp,
    speed: usize,
    /// Factor that makes speeds m/s; `None`: it is named nowhere.
    unit: Option<f64>,
}

impl Columns for SpeedColumns {
    type Entry = Sample;

    fn by_names(header: &Header) -> Result<Self, String> {
        let columns = header.listed();
        if header.find(DIRECTIONS).is_some() {
            return Err(format!(
                "its columns {columns} have a direction: write what goes backwards with a minus, and remove the direction"
            ));
        }
        let missing = |what| format!("its columns {columns} have no {what}: {REMEDY}");
        let speed = header.first(|name| unit_of(name, NAMES, &UNITS));
        let (speed, unit) = speed.ok_or_else(|| missing("speed"))?;
        Ok(Self {
            stamp: header.stamp().ok_or_else(|| missing("stamps"))?,
            speed,
            unit,
        })
    }

    fn entry(&self, row: &StringRecord) -> Option<Sample> {
        let speed = row.get(self.speed)?.parse::<f64>().ok()? * self.unit.unwrap_or(1.0);
        Some(Sample::speed(self.stamp.ns(row)?, speed))
    }
}

/// Shortest time between the two counts of a speed: over less, ticks are too coarse.
const SPAN_NS: i64 = 90_000_000;

/// Names of the ticks of one wheel, or of an axle.
const TICKS: [&str; 4] = ["ticks", "pulses", "wheel_ticks", "encoder_ticks"];
/// Names of the ticks of two wheels of an axle; their mean is used.
const LEFT_AND_RIGHT: [[&str; 2]; 3] = [
    ["left_ticks", "right_ticks"],
    ["ticks_left", "ticks_right"],
    ["left_count", "right_count"],
];
const METRES: [&str; 3] = ["distance_m", "odometer_m", "mileage_m"];

/// Any count is plausible: only speeds are checked.
const COUNTS: Plausible = Plausible {
    of: SampleKind::Wheels,
    values: 2,
    most: f64::MAX,
    beyond: "",
};

struct CountColumns {
    stamp: Stamp,
    counts: Vec<usize>,
    is_in_ticks: bool,
}

impl Columns for CountColumns {
    type Entry = Sample;

    fn by_names(header: &Header) -> Result<Self, String> {
        if header.find(DIRECTIONS).is_some() {
            return Err("its direction is not applied to counts".to_owned());
        }
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
        let mut sample = Sample::speed(self.stamp.ns(row)?, 0.0);
        let columns = self.counts.iter().cycle();
        for (value, column) in sample.values[..2].iter_mut().zip(columns) {
            *value = row.get(*column)?.parse().ok()?;
        }
        Some(sample)
    }
}

/// Makes speeds of counts: each is the mean of the time between two, and has the stamp of its
/// middle. Speeds that no vehicle has, as after a reset of the counter, are left out.
fn speeds(
    rows: Rows<CountColumns>,
    path: &Path,
    m_per_tick: Option<f64>,
) -> Result<SampleLog, LogError> {
    let unusable = |reason: &str| LogError::unusable(OF, path, reason);
    let is_in_ticks = rows.columns.is_in_ticks;
    let missing = "it counts ticks: give the distance of one, in metres, as wheels.m_per_tick";
    let m_per_count = match is_in_ticks {
        true => m_per_tick.ok_or_else(|| unusable(missing))?,
        false => 1.0,
    };
    let mut log = examine(rows.raw, false, path, &COUNTS)?;
    (0..2).for_each(|wheel| count_on(&mut log.samples, wheel));
    let mut speeds = Vec::with_capacity(log.samples.len());
    let mut from = log.samples[0];
    for to in &log.samples {
        let span_ns = to.stamp_ns - from.stamp_ns;
        if span_ns >= SPAN_NS {
            let by = |wheel: usize| to.values[wheel] - from.values[wheel];
            let way_m = (by(0) + by(1)) / 2.0 * m_per_count;
            let speed_mps = way_m / (span_ns as f64 * 1e-9);
            speeds.push(Sample::speed(from.stamp_ns + span_ns / 2, speed_mps));
            from = *to;
        }
    }
    let before = speeds.len();
    if before == 0 {
        return Err(unusable("it is shorter than 0.09 s"));
    }
    speeds.retain(|speed| speed.values[0].abs() <= SPEEDS.most);
    let absurd = before - speeds.len();
    if absurd as f64 > ABSURD_SHARE * before as f64 && absurd > 1 || speeds.is_empty() {
        let remedy = match is_in_ticks {
            true => "is wheels.m_per_tick in metres?",
            false => "is the distance in metres?",
        };
        let reason = format!("{absurd} of its {before} speeds are beyond 100 m/s: {remedy}");
        return Err(unusable(&reason));
    }
    log.faults.absurd += absurd;
    log.samples = speeds;
    Ok(log)
}

/// Unwraps a counter that overflows. The range of the counter is a power of two, or the size of
/// its jumps if all jumps are equal; a single other jump is a restart of the counter.
fn count_on(counts: &mut [Sample], wheel: usize) {
    let mut values: Vec<f64> = counts.iter().map(|it| it.values[wheel]).collect();
    values.sort_unstable_by(f64::total_cmp);
    // Without a hundredth at each end: single rows are corrupt.
    let margin = values.len() / 100;
    let range = values[values.len() - 1 - margin] - values[margin];
    let apart = |pair: &[Sample]| pair[1].values[wheel] - pair[0].values[wheel];
    let steps: Vec<f64> = counts.windows(2).map(apart).collect();
    let (jumps, others): (Vec<usize>, Vec<usize>) =
        (0..steps.len()).partition(|k| steps[*k].abs() > 0.5 * range);
    let largest = others.iter().map(|k| steps[*k].abs()).fold(0.0, f64::max);
    // The counter would have gone on as before.
    let before = |k: usize| k.checked_sub(1).map_or(0.0, |before| steps[before].abs());
    let size = |k: &usize| steps[*k].abs() + before(*k).min(largest);
    let Some(usual) = median(jumps.iter().map(size)) else {
        return;
    };
    let is_usual = |size: f64| (size - usual).abs() <= largest;
    let bits = usual.log2().round().exp2();
    let repeats = jumps.len() > 1 && jumps.iter().all(|k| is_usual(size(k)));
    let modulus = match is_usual(bits) && bits > range {
        true => bits,
        false if repeats && usual + largest > range => usual.max(range),
        false => return,
    };
    let mut turns = 0.0;
    for (count, step) in counts[1..].iter_mut().zip(steps) {
        if step.abs() > 0.5 * range {
            turns -= step.signum();
        }
        count.values[wheel] += turns * modulus;
    }
}
