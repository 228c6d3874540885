//! The log of the wheels' speed as a file: a table as CSV.
//!
//! `counts`: the log of an encoder or an odometer, converted to speeds.

mod counts;

use std::path::{Path, PathBuf};

use csv::StringRecord;
use gyre_geometry::samples::{Sample, SampleKind};

use counts::CountColumns;

use crate::{
    LogError, SampleLog,
    gyro_log::faults::{Plausible, examine},
    header::{Header, Stamp, unit_of},
    logs,
    table::{Columns, Raw},
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
            Ok(rows) => counts::speeds(rows, path, m_per_tick),
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
