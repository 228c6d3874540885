//! The log of a gyro as a file.
//!
//! - [`GyroLog`]: where it lies beside the scans of a dataset, and how it is read;
//! - `columns`: which columns of a table are what;
//! - `twist`: the files of RADIATE, one for each sample;
//! - [`SampleTrack`]: its samples in the vehicle's axes on the radar's clock;
//! - `faults`: what is wrong with the samples, and which of them are left out; `jumps`: which of
//!   them change faster than a vehicle can.

mod columns;
mod error;
pub(crate) mod faults;
mod jumps;
mod track;
mod twist;

use std::path::{Path, PathBuf};

pub use error::LogError;
pub use faults::{LogFaults, LogGap};
pub use track::SampleTrack;

use gyre_samples::{Sample, SampleKind, UpAxis};
use gyre_storage as storage;

use crate::{
    Format,
    gps_imu_twist::has_list,
    table::{Columns, MAX_BYTES, Rows, Unreadable},
};

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

/// Folders of images, beside which the log lies too if one of them is given for the dataset.
const IMAGES: [&str; 5] = [
    "radar",
    "Navtech_Polar",
    "navtech",
    "polar",
    "polar_oxford_form",
];

/// The log of a gyro, in its own axes and on its own clock.
#[derive(Clone, Debug, Default)]
pub struct GyroLog {
    /// The samples in the order of their stamps, which all differ. Rates are in rad/s,
    /// accelerations in m/s²: all zero where the log has none.
    pub samples: Vec<Sample>,
    /// Faults of the log, with the number of samples that were left out for each.
    pub faults: LogFaults,
    /// The file, or the folder of files.
    pub path: PathBuf,
}

impl GyroLog {
    /// Reads a log. The first row, or the number of columns, says of which format it is.
    ///
    /// # Errors
    /// A file that cannot be read or has no angular rates, and one whose stamps or rates cannot be
    /// those of a gyro.
    pub fn read(path: &Path) -> Result<Self, LogError> {
        let raw = match path.is_dir() {
            true => twist::read(path)?,
            false => read_table::<columns::Columns>(path)?,
        };
        let (samples, faults) = faults::examine(raw, path, &faults::RATES)?;
        Ok(Self {
            samples,
            faults,
            path: path.to_owned(),
        })
    }

    /// Returns the log that lies beside the scans of a dataset folder.
    pub fn beside(folder: &Path) -> Option<PathBuf> {
        Self::find(folder).ok()
    }

    /// Returns the log that lies beside the scans of a dataset folder, which may also be that of
    /// the images.
    ///
    /// # Errors
    /// No log, or only one of which the ground truth was made.
    pub fn find(folder: &Path) -> Result<PathBuf, LogError> {
        let roots = || roots(folder);
        let found = roots()
            .flat_map(|root| PLACES.iter().map(|place| root.join(place)))
            .find(|path| path.is_file() || (path.is_dir() && has_list(path)));
        let in_truth = || roots().map(|root| root.join(error::IN_TRUTH));
        found.ok_or_else(|| match in_truth().find(|path| path.is_file()) {
            Some(path) => LogError::InTruth { path },
            None => LogError::None {
                of: SampleKind::Gyro,
                folder: folder.to_owned(),
            },
        })
    }

    /// Returns the axis that points up: the configured one, or that by gravity or the format.
    ///
    /// # Errors
    /// Both contradict each other.
    pub fn up(&self, configured: Option<UpAxis>, dataset: Format) -> Result<UpAxis, LogError> {
        // Of RADIATE's logs z points down, and gravity is taken out of their accelerations.
        let is_radiates = dataset == Format::Radiate && self.path.ends_with("imu_as_logged.csv")
            || self.path.ends_with("GPS_IMU_Twist");
        let measured = self.up_by_gravity();
        let known = measured.or(is_radiates.then_some(UpAxis::MinusZ));
        let up = configured.or(known).unwrap_or_default();
        match known.filter(|known| *known != up) {
            None => Ok(up),
            Some(known) => Err(LogError::Unusable {
                of: SampleKind::Gyro,
                path: self.path.clone(),
                reason: format!(
                    "gyro.up is {}, but by {} its axis {} points up: take gyro.up out of the configuration, or the accelerations out of the log if their sign is wrong",
                    up.name(),
                    measured.map_or("its format", |_| "gravity"),
                    known.name()
                ),
            }),
        }
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

    /// Takes the samples of a bag or of a simulation, which messages name by this path.
    ///
    /// # Errors
    /// Stamps or rates that cannot be those of a gyro.
    pub fn of(samples: Vec<Sample>, path: &Path) -> Result<Self, LogError> {
        let raw = Raw::of(samples);
        let (samples, faults) = faults::examine(raw, path, &faults::RATES)?;
        Ok(Self {
            samples,
            faults,
            path: path.to_owned(),
        })
    }
}

/// Returns the folders in which the logs of a dataset are looked for: its own, and the one above
/// that of the images.
pub(crate) fn roots(folder: &Path) -> impl Iterator<Item = &Path> {
    let name = folder.file_name().and_then(|name| name.to_str());
    let is_of_images = name.is_some_and(|name| IMAGES.contains(&name));
    let above = folder.parent().filter(|_| is_of_images);
    [Some(folder), above].into_iter().flatten()
}

/// The columns of a table in which each row is a sample.
pub(crate) trait SampleColumns: Columns<Entry = Sample> {
    /// The sensor.
    const OF: SampleKind;

    /// The unit of the values is named nowhere.
    fn unit_is_assumed(&self) -> bool;
}

/// Reads a table of samples.
pub(crate) fn read_table<C: SampleColumns>(path: &Path) -> Result<Raw, LogError> {
    let text = storage::read_text(path, MAX_BYTES).map_err(|source| LogError::Io {
        of: C::OF,
        path: path.to_owned(),
        source,
    })?;
    let rows = Rows::<C>::of(&text).map_err(|reason| LogError::Unknown {
        of: C::OF,
        path: path.to_owned(),
        reason,
    })?;
    Ok(Raw {
        unit_is_assumed: rows.columns.unit_is_assumed(),
        samples: rows.entries,
        unreadable: rows.unreadable,
        unmeasured: rows.unmeasured,
    })
}

/// The samples of a file as they stand there.
#[derive(Debug, Default)]
pub(crate) struct Raw {
    samples: Vec<Sample>,
    unreadable: Unreadable,
    /// Rows that state that nothing was measured.
    unmeasured: usize,
    /// The unit of the values is named nowhere.
    pub(crate) unit_is_assumed: bool,
}

impl Raw {
    /// Samples that are of no file.
    pub(crate) fn of(samples: Vec<Sample>) -> Self {
        Self {
            samples,
            ..Self::default()
        }
    }
}
