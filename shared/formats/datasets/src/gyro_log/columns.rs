//! The columns of tables: by the names in the header, or by their number.

use std::f64::consts::PI;

use crate::{parse_seconds, stamp_to_ns};
use gyre_storage::quoted;

/// Where a table has what.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Columns {
    pub(super) stamp: (usize, StampUnit),
    pub(super) rates: [usize; 3],
    /// Factor that makes the rates rad/s.
    pub(super) rate_unit: f64,
    /// The unit of the rates is named nowhere.
    pub(super) unit_is_assumed: bool,
    pub(super) accelerations: Option<([usize; 3], f64)>,
}

/// Times are at most 146 years from 1970, so that no difference overflows.
const MAX_NS: i64 = i64::MAX / 2;

/// The unit of stamps.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum StampUnit {
    /// An integer number of so many ns.
    Ns(i64),
    /// Decimal seconds.
    Seconds,
    /// Decimal seconds, or an integer whose size says its unit.
    BySize,
}

impl StampUnit {
    /// Returns the time of a stamp, ns.
    pub(crate) fn ns(self, text: &str) -> Option<i64> {
        let ns = match self {
            Self::Ns(unit) => text.parse::<i64>().ok()?.checked_mul(unit),
            Self::Seconds => parse_seconds(text),
            Self::BySize => match text.parse::<i64>() {
                Ok(raw) => stamp_to_ns(raw),
                Err(_) => parse_seconds(text),
            },
        };
        ns.filter(|ns| (-MAX_NS..=MAX_NS).contains(ns))
    }
}

/// Names of the column of stamps that have no unit.
const STAMPS: [&str; 8] = [
    "timestamp",
    "stamp",
    "time",
    "t",
    "gpstime",
    "header_stamp",
    "utime",
    "unix_time",
];
/// Units at the end of a stamp's name.
const STAMP_UNITS: [(&str, StampUnit); 8] = [
    ("_ns", StampUnit::Ns(1)),
    ("_us", StampUnit::Ns(1_000)),
    ("_ms", StampUnit::Ns(1_000_000)),
    ("_s", StampUnit::Seconds),
    ("_sec", StampUnit::Seconds),
    ("(ns)", StampUnit::Ns(1)),
    ("(us)", StampUnit::Ns(1_000)),
    ("(s)", StampUnit::Seconds),
];

/// Names of angular rates, `*` for the axis.
const RATES: [&str; 10] = [
    "gyro_*",
    "gyr_*",
    "w*",
    "w_*",
    "omega_*",
    "angular_velocity_*",
    "angular_rate_*",
    "angvel_*",
    "ang_vel_*",
    "rate_*",
];
/// Units at the end of a rate's name.
const RATE_UNITS: [(&str, f64); 9] = [
    ("_radps", 1.0),
    ("_rad_s", 1.0),
    ("_rad_per_s", 1.0),
    ("_rps", 1.0),
    ("_degps", PI / 180.0),
    ("_deg_s", PI / 180.0),
    ("_deg_per_s", PI / 180.0),
    ("_dps", PI / 180.0),
    ("_mdps", PI / 180e3),
];

/// Names of accelerations.
const ACCELERATIONS: [&str; 8] = [
    "accel_*",
    "acc_*",
    "a*",
    "a_*",
    "linear_acceleration_*",
    "acceleration_*",
    "accel*",
    "lin_acc_*",
];
/// Units at the end of an acceleration's name.
const ACCELERATION_UNITS: [(&str, f64); 5] = [
    ("_mps2", 1.0),
    ("_m_s2", 1.0),
    ("_m_per_s2", 1.0),
    ("_g", 9.80665),
    ("_mg", 9.80665e-3),
];

/// Headers of datasets, whose rates are in rad/s though they do not say so: Boreas-RT `dmu_imu.csv`
/// and `aeva_imu.csv`, Boreas `applanix/imu.csv`.
const KNOWN: [&[&str]; 2] = [
    &["time", "wx", "wy", "wz", "ax", "ay", "az"],
    &[
        "gpstime", "angvel_z", "angvel_y", "angvel_x", "accelz", "accely", "accelx",
    ],
];
/// FoMo `vectornav.csv` and `xsens.csv`, in which `a` are angular rates, `l` accelerations.
const FOMO: [&str; 7] = ["t", "ax", "ay", "az", "lx", "ly", "lz"];
/// Columns of MulRan `xsens_imu.csv`, which has no header: stamp (ns), quaternion, Euler angles,
/// rates, accelerations, magnetic field.
const MULRAN: usize = 17;
/// Columns of its first version, without rates.
const MULRAN_WITHOUT_RATES: usize = 8;

/// The remedy, for messages.
const REMEDY: &str = "the first row must name the columns, as in `stamp_ns,gyro_x_radps,gyro_y_radps,gyro_z_radps` (also stamp_us, stamp_s; _degps)";

impl Columns {
    /// Finds the columns of a table by its first row.
    pub(super) fn of(first: &csv::StringRecord) -> Result<Self, String> {
        match first.iter().all(|field| field.parse::<f64>().is_ok()) {
            true => Self::by_number(first.len()),
            false => Self::by_names(first.iter().map(plain).collect()),
        }
    }

    fn by_number(columns: usize) -> Result<Self, String> {
        match columns {
            MULRAN => Ok(Self {
                stamp: (0, StampUnit::Ns(1)),
                rates: [8, 9, 10],
                rate_unit: 1.0,
                unit_is_assumed: false,
                accelerations: Some(([11, 12, 13], 1.0)),
            }),
            MULRAN_WITHOUT_RATES => Err(format!(
                "as the first version of MulRan's xsens_imu.csv it has orientations and no angular rates, but {MULRAN} columns have them: download the recording anew"
            )),
            _ => Err(format!(
                "its {columns} columns have no names, and only the {MULRAN} of MulRan's xsens_imu.csv are known without: {REMEDY}"
            )),
        }
    }

    fn by_names(names: Vec<String>) -> Result<Self, String> {
        if names == FOMO {
            return Ok(Self {
                stamp: (0, StampUnit::BySize),
                rates: [1, 2, 3],
                rate_unit: 1.0,
                unit_is_assumed: false,
                accelerations: Some(([4, 5, 6], 1.0)),
            });
        }
        if let Some(name) =
            (1..names.len()).find_map(|k| names[..k].iter().find(|it| **it == names[k]))
        {
            return Err(format!("two of its columns are named {}", quoted(name)));
        }
        let stamp = names.iter().enumerate().find_map(|(k, name)| {
            let unit = stamp_unit(name)?;
            Some((k, unit))
        });
        let Some((rates, unit)) = vector(&names, &RATES, &RATE_UNITS) else {
            let inertial = names.iter().any(|name| name == "ins_status");
            let hint = match inertial {
                true => "the INS logs of Oxford and OORD have positions and attitudes alone",
                false => REMEDY,
            };
            let columns = quoted(&names.join(","));
            return Err(format!(
                "its columns {columns} have no angular rates about three axes: {hint}"
            ));
        };
        Ok(Self {
            stamp: stamp.ok_or_else(|| format!("it has no column of stamps: {REMEDY}"))?,
            rates,
            rate_unit: unit.unwrap_or(1.0),
            unit_is_assumed: unit.is_none() && !KNOWN.iter().any(|known| names == *known),
            accelerations: vector(&names, &ACCELERATIONS, &ACCELERATION_UNITS)
                .map(|(columns, unit)| (columns, unit.unwrap_or(1.0))),
        })
    }
}

/// Returns a name of a column with what programs write in different ways made equal.
pub(crate) fn plain(name: &str) -> String {
    let name = name.trim().trim_start_matches(['%', '#']);
    let name = name.strip_prefix("field.").unwrap_or(name).trim();
    let name = name.to_lowercase().replace([' ', '.', '/', '['], "_");
    name.replace(']', "").replace("__", "_").replace("^2", "2")
}

/// Returns the unit of a column of stamps by its name; `None` for another column.
pub(crate) fn stamp_unit(name: &str) -> Option<StampUnit> {
    let with_unit = |(unit, meaning): &(&str, StampUnit)| {
        let named = name.strip_suffix(unit)?;
        STAMPS.contains(&named).then_some(*meaning)
    };
    let by_name = STAMP_UNITS.iter().find_map(with_unit);
    by_name.or_else(|| STAMPS.contains(&name).then_some(StampUnit::BySize))
}

/// The columns of a vector, and its unit if the names have one.
type Vector = ([usize; 3], Option<f64>);

/// Finds a vector whose three names follow one pattern and end with one unit.
fn vector(names: &[String], patterns: &[&str], units: &[(&str, f64)]) -> Option<Vector> {
    let units = units.iter().map(|(name, factor)| (*name, Some(*factor)));
    let units = units.chain([("", None)]);
    let forms = patterns
        .iter()
        .flat_map(|pattern| units.clone().map(move |unit| (*pattern, unit)));
    forms.into_iter().find_map(|(pattern, (unit, factor))| {
        let column = |axis: &str| {
            let wanted = pattern.replace('*', axis) + unit;
            names.iter().position(|name| *name == wanted)
        };
        Some(([column("x")?, column("y")?, column("z")?], factor))
    })
}
