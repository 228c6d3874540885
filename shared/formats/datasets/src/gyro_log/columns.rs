//! The columns of tables: by the names in the header, or by their number.

use std::f64::consts::PI;

use csv::StringRecord;
use gyre_geometry::samples::{Sample, SampleKind};

use crate::{
    header::{Header, Stamp, endings},
    table::Columns,
};

pub(super) struct GyroColumns {
    stamp: Stamp,
    rates: [usize; 3],
    /// Factor that makes the rates rad/s.
    rate_unit: f64,
    /// The unit of the rates is named nowhere.
    pub unit_is_assumed: bool,
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
pub(super) fn sample(stamp_ns: i64, [rates, accelerations]: [[f64; 3]; 2]) -> Sample {
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
