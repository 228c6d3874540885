//! The log of a gyro as a file, whose columns are known by the names in the header, or by their
//! number.

pub(crate) mod faults;
pub(crate) mod jumps;

use std::{
    f64::consts::PI,
    path::{Path, PathBuf},
};

pub use faults::{LogFaults, LogGap};

use csv::StringRecord;
use gyre_geometry::samples::{Sample, SampleKind, UpAxis};

use crate::{
    Format, LogError,
    header::{Header, Stamp, endings},
    logs,
    table::{Columns, Raw},
};

const OF: &str = SampleKind::Gyro.section();
/// The log of the INS that Boreas' ground truth was computed from.
const IN_TRUTH: &str = "applanix/imu.csv";

/// Logs relative to the root of a dataset, in order of precedence.
const PLACES: [&str; 12] = [
    "imu_as_logged.csv",
    "imu.csv",
    "gyro.csv",
    // Boreas-RT
    "imu/dmu_imu.csv",
    "imu/dmu_imu_infilled.csv",
    "imu/aeva_imu.csv",
    // MulRan
    "sensor_data/xsens_imu.csv",
    "xsens_imu.csv",
    // FoMo
    "vectornav.csv",
    "xsens.csv",
    // RADIATE
    "GPS_IMU_Twist",
    "imu/imu.csv",
];

/// Accelerations that can be gravity's, m/s², and its share along the axis that points up.
const GRAVITY_MPS2: std::ops::RangeInclusive<f64> = 9.3..=10.3;
const UPRIGHT: f64 = 0.9;

/// The log of a gyro or of wheels, in its own axes and on its own clock.
#[derive(Clone, Debug, Default)]
pub struct SampleLog {
    /// The samples in the order of their stamps, which all differ. Rates are in rad/s, speeds in
    /// m/s, accelerations in m/s²: all zero where the log has none.
    pub samples: Vec<Sample>,
    pub faults: LogFaults,
    pub path: PathBuf,
}

impl SampleLog {
    /// Reads the log of a gyro. The first row, or the number of columns, determines the format.
    pub fn read_gyro(path: &Path) -> Result<Self, LogError> {
        if path.is_dir() {
            // The lines of the angular rates and of the accelerations.
            let raw = logs::gps_imu_twist(path, [5, 6], sample)?;
            return faults::examine(raw, false, path, &faults::RATES);
        }
        let rows = logs::rows::<GyroColumns>(path, OF)?;
        let unit_is_assumed = rows.columns.unit_is_assumed;
        faults::examine(rows.raw, unit_is_assumed, path, &faults::RATES)
    }

    /// Returns the log beside the scans of a dataset folder, which may also be the folder of the
    /// images.
    pub fn find_gyro(folder: &Path) -> Result<PathBuf, LogError> {
        logs::find(folder, OF, &PLACES).map_err(|missing| {
            let mut in_truth = logs::roots(folder).map(|root| root.join(IN_TRUTH));
            match in_truth.find(|path| path.is_file()) {
                Some(path) => LogError::InTruth { path },
                None => missing,
            }
        })
    }

    /// Returns the axis that points up: the configured one, or that by gravity or the format.
    pub fn up(&self, configured: Option<UpAxis>, dataset: Format) -> Result<UpAxis, LogError> {
        // Of RADIATE's logs z points down, and gravity is taken out of their accelerations.
        let is_radiates = dataset == Format::Radiate && self.path.ends_with("imu_as_logged.csv")
            || self.path.ends_with("GPS_IMU_Twist");
        let measured = self.up_by_gravity();
        let known = measured.or(is_radiates.then_some(UpAxis::MinusZ));
        let up = configured.or(known).unwrap_or_default();
        let Some(known) = known.filter(|known| *known != up) else {
            return Ok(up);
        };
        let by = measured.map_or("its format", |_| "gravity");
        let (up, known) = (up.name(), known.name());
        let reason = format!(
            "gyro.up is {up}, but by {by} its axis {known} points up: take gyro.up out of the configuration, or the accelerations out of the log if their sign is wrong"
        );
        Err(LogError::unusable(OF, &self.path, reason))
    }

    /// Returns the axis along which the accelerations have gravity: what rests is accelerated
    /// upwards.
    pub(crate) fn up_by_gravity(&self) -> Option<UpAxis> {
        use UpAxis::{MinusX, MinusY, MinusZ, X, Y, Z};
        let sum = |k: usize| self.samples.iter().map(|it| it.values[k]).sum::<f64>();
        let mean = [3, 4, 5].map(|k| sum(k) / self.samples.len().max(1) as f64);
        let norm = mean.iter().map(|value| value * value).sum::<f64>().sqrt();
        let mut axes = [X, MinusX, Y, MinusY, Z, MinusZ].into_iter();
        axes.find(|up| up.in_vehicle(mean)[2] > UPRIGHT * norm)
            .filter(|_| GRAVITY_MPS2.contains(&norm))
    }

    /// Takes the samples of a gyro in a bag or a simulation, which messages name by this path.
    pub fn of_gyro(samples: Vec<Sample>, path: &Path) -> Result<Self, LogError> {
        faults::examine(Raw::of(samples), false, path, &faults::RATES)
    }
}

struct GyroColumns {
    stamp: Stamp,
    rates: [usize; 3],
    /// Factor that makes the rates rad/s.
    rate_unit: f64,
    /// The unit of the rates is named nowhere.
    unit_is_assumed: bool,
    accelerations: Option<([usize; 3], f64)>,
}

/// Names of angular rates, `*` for the axis; the last is EuRoC's, as of accelerations.
const RATES: &str = "gyro_* gyr_* w* w_* omega_* angular_velocity_* angular_rate_* angvel_* \
    ang_vel_* rate_* angularvelocity* gyroscope_* gyro* g* g_* w_rs_s_*";
const RATE_UNITS: [(&str, f64); 3] = [
    ("_rad_s^-1 _radps _rad_s _rad_per_s _rps", 1.0),
    ("_°_s _degps _deg_s _deg_per_s _dps", PI / 180.0),
    ("_mdps", PI / 180e3),
];

const ACCELERATIONS: &str = "accel_* acc_* a* a_* linear_acceleration_* acceleration_* accel* \
    lin_acc_* a_rs_s_*";
const ACCELERATION_UNITS: [(&str, f64); 3] = [
    ("_m_s^-2 _mps2 _m_s2 _m_per_s2", 1.0),
    ("_g", 9.80665),
    ("_mg", 9.80665e-3),
];

/// Headers of datasets, whose rates are in rad/s although the headers do not name the unit:
/// Boreas-RT `dmu_imu.csv` and `aeva_imu.csv`, Boreas `applanix/imu.csv`.
const KNOWN: [&[&str]; 2] = [
    &["time", "wx", "wy", "wz", "ax", "ay", "az"],
    &[
        "gpstime", "angvel_z", "angvel_y", "angvel_x", "accelz", "accely", "accelx",
    ],
];
/// FoMo `vectornav.csv` and `xsens.csv`: `a` are angular rates, `l` accelerations.
const FOMO: [&str; 7] = ["t", "ax", "ay", "az", "lx", "ly", "lz"];
/// Columns of MulRan `xsens_imu.csv`, which has no header: stamp (ns), quaternion, Euler angles,
/// rates, accelerations, magnetic field.
const MULRAN: usize = 17;
/// Columns of its first version, without rates.
const MULRAN_WITHOUT_RATES: usize = 8;

const REMEDY: &str = "the first row must name the columns, as in `stamp_ns,gyro_x_radps,gyro_y_radps,gyro_z_radps` (also stamp_us, stamp_s; _degps)";

impl GyroColumns {
    fn known(stamp: Stamp, rates: [usize; 3], accelerations: [usize; 3]) -> Self {
        Self {
            stamp,
            rates,
            rate_unit: 1.0,
            unit_is_assumed: false,
            accelerations: Some((accelerations, 1.0)),
        }
    }
}

impl Columns for GyroColumns {
    type Entry = Sample;

    fn by_number(columns: usize) -> Result<Self, String> {
        match columns {
            MULRAN => Ok(Self::known(Stamp::first(false), [8, 9, 10], [11, 12, 13])),
            MULRAN_WITHOUT_RATES => Err(format!(
                "as the first version of MulRan's xsens_imu.csv it has orientations and no angular rates, but {MULRAN} columns have them: download the recording anew"
            )),
            _ => Err(format!(
                "its {columns} columns have no names, and only the {MULRAN} of MulRan's xsens_imu.csv are known without: {REMEDY}"
            )),
        }
    }

    fn by_names(header: &Header) -> Result<Self, String> {
        let names = header.names();
        let missing =
            |what, hint| format!("its columns {} have no {what}: {hint}", header.listed());
        if names == FOMO {
            return Ok(Self::known(Stamp::first(true), [1, 2, 3], [4, 5, 6]));
        }
        let Some((rates, unit)) = vector(header, RATES, &RATE_UNITS) else {
            let hint = match header.find("ins_status") {
                Some(_) => "the INS logs of Oxford and OORD have positions and attitudes alone",
                None => REMEDY,
            };
            return Err(missing("angular rates about three axes", hint));
        };
        Ok(Self {
            stamp: header.stamp().ok_or_else(|| missing("stamps", REMEDY))?,
            rates,
            rate_unit: unit.unwrap_or(1.0),
            unit_is_assumed: unit.is_none() && !KNOWN.iter().any(|known| names == *known),
            accelerations: vector(header, ACCELERATIONS, &ACCELERATION_UNITS)
                .map(|(columns, unit)| (columns, unit.unwrap_or(1.0))),
        })
    }

    fn entry(&self, row: &StringRecord) -> Option<Sample> {
        let read = |columns: [usize; 3], factor: f64| {
            let mut values = [0.0; 3];
            for (value, column) in values.iter_mut().zip(columns) {
                *value = row.get(column)?.parse::<f64>().ok()? * factor;
            }
            Some(values)
        };
        let stamp_ns = self.stamp.ns(row)?;
        let rates = read(self.rates, self.rate_unit)?;
        let accelerations = self.accelerations.and_then(|(at, factor)| read(at, factor));
        let accelerations = accelerations.unwrap_or_default();
        Some(sample(stamp_ns, [rates, accelerations]))
    }
}

/// A sample of rates and accelerations, which are zero if one of them is not finite.
fn sample(stamp_ns: i64, [rates, accelerations]: [[f64; 3]; 2]) -> Sample {
    let are_finite = accelerations.iter().all(|value| value.is_finite());
    let [x, y, z] = rates;
    let [ax, ay, az] = if are_finite { accelerations } else { [0.0; 3] };
    Sample {
        stamp_ns,
        kind: SampleKind::Gyro as u32,
        reserved: 0,
        values: [x, y, z, ax, ay, az],
    }
}

type Vector = ([usize; 3], Option<f64>);

fn vector(header: &Header, patterns: &str, units: &[(&'static str, f64)]) -> Option<Vector> {
    let units = endings(units).into_iter();
    let units = units.map(|(name, factor)| (name, Some(factor)));
    let units = units.chain([("", None)]);
    let patterns = patterns.split(' ');
    let mut forms = patterns.flat_map(|pattern| units.clone().map(move |unit| (pattern, unit)));
    forms.find_map(|(pattern, (unit, factor))| {
        let column = |axis: &str| header.find(&(pattern.replace('*', axis) + unit));
        Some(([column("x")?, column("y")?, column("z")?], factor))
    })
}
