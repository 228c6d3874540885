//! The log of a gyro as a file.

mod columns;
pub(crate) mod faults;
pub(crate) mod jumps;

use std::path::{Path, PathBuf};

pub use faults::{LogFaults, LogGap};

use gyre_geometry::samples::{Sample, SampleKind, UpAxis};

use crate::{Format, LogError, gps_imu_twist, logs, table::Raw};
use columns::GyroColumns;

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
            let raw = gps_imu_twist::read(path, [5, 6], columns::sample)?;
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
