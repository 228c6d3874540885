//! The log of a GNSS receiver as a file.
//!
//! - [`GnssLog`]: where it lies beside the scans of a dataset, and how it is read;
//! - `table`: tables as CSV; `radiate`: the files of RADIATE, one for each fix;
//! - `faults`: what is wrong with the fixes, and which of them are left out.

mod error;
mod faults;
mod radiate;
mod table;

use std::path::{Path, PathBuf};

pub use error::GnssLogError;
pub use faults::GnssFaults;

use gyre_samples::{Geographic, GnssConfig, GnssFix, GnssKind, LocalPlane};

use crate::{gps_imu_twist::has_list, gyro_log::roots};

/// Logs relative to the root of a dataset, in order of precedence.
const PLACES: [&str; 8] = [
    "gnss_as_logged.csv",
    "gnss.csv",
    // Oxford and OORD
    "gps/gps.csv",
    // MulRan
    "sensor_data/gps.csv",
    "gps.csv",
    // RADIATE
    "GPS_IMU_Twist",
    "gnss_as_logged.tum",
    "gnss.tum",
];

/// The log of a GNSS receiver, on its own clock.
#[derive(Clone, Debug, Default)]
pub struct GnssLog {
    /// The fixes in the order of their stamps, which all differ.
    pub fixes: Vec<LoggedFix>,
    /// The plane in which the fixes are, which touches the earth at the first of them; `None` if
    /// the log has coordinates in a plane of its own.
    pub plane: Option<LocalPlane>,
    /// Faults of the log, with the number of fixes that were left out for each.
    pub faults: GnssFaults,
    /// The file, or the folder of files.
    pub path: PathBuf,
}

/// A fix as it was logged.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LoggedFix {
    /// Time on the receiver's clock, ns since 1970.
    pub stamp_ns: i64,
    /// Place in the plane, m east and north.
    pub east_north_m: [f64; 2],
    /// Standard deviation along each of both axes that the log states, m.
    pub sigma_m: Option<f64>,
}

impl GnssLog {
    /// Reads a log. The first row, or the number of columns, says of which format it is.
    ///
    /// # Errors
    /// A file that cannot be read or has no positions, and one without a usable fix.
    pub fn read(path: &Path) -> Result<Self, GnssLogError> {
        let raw = match path.is_dir() {
            true => radiate::read(path)?,
            false => table::read(path)?,
        };
        Self::of(raw, path)
    }

    /// Returns the log that lies beside the scans of a dataset, which may also be named by the
    /// folder of the images.
    ///
    /// # Errors
    /// No log.
    pub fn find(folder: &Path) -> Result<PathBuf, GnssLogError> {
        // Of a bag or another recording in one file, the folder in which it lies.
        let folder = match folder.is_file() {
            true => folder.parent().unwrap_or(folder),
            false => folder,
        };
        roots(folder)
            .flat_map(|root| PLACES.iter().map(|place| root.join(place)))
            .find(|path| path.is_file() || (path.is_dir() && has_list(path)))
            .ok_or_else(|| GnssLogError::None {
                folder: folder.to_owned(),
            })
    }

    /// Opens what the section `[gnss]` names for the dataset in this folder; `None` without one.
    ///
    /// # Errors
    /// No log beside the scans, or one that cannot be read.
    pub fn open(config: &GnssConfig, folder: &Path) -> Result<Option<Self>, GnssLogError> {
        let path = match config.kind {
            GnssKind::None => return Ok(None),
            GnssKind::Auto => Self::find(folder)?,
            GnssKind::Log => config.file.clone().unwrap_or_default(),
        };
        Self::read(&path).map(Some)
    }

    /// Returns the fixes on the radar's clock, with the configured uncertainty where the log has
    /// none.
    pub fn on_radar(&self, config: &GnssConfig) -> Vec<GnssFix> {
        let late_ns = (config.late_s * 1e9).round() as i64;
        let fixes = self.fixes.iter().map(|fix| GnssFix {
            stamp_ns: fix.stamp_ns.saturating_sub(late_ns),
            east_m: fix.east_north_m[0],
            north_m: fix.east_north_m[1],
            sigma_m: fix.sigma_m.unwrap_or(config.sigma_m),
        });
        fixes.collect()
    }

    fn of(raw: Raw, path: &Path) -> Result<Self, GnssLogError> {
        let (fixes, plane, faults) =
            faults::examine(raw).map_err(|reason| GnssLogError::Unusable {
                path: path.to_owned(),
                reason,
            })?;
        Ok(Self {
            fixes,
            plane,
            faults,
            path: path.to_owned(),
        })
    }
}

/// The fixes of a file as they stand there.
#[derive(Debug, Default)]
struct Raw {
    rows: Vec<RawFix>,
    /// The coordinates are m east and north, and not degrees of latitude and longitude.
    is_plane: bool,
    /// Rows that are none of the table, and the line of the first.
    unreadable: usize,
    first_unreadable: usize,
}

/// A row of a log.
#[derive(Clone, Copy, Debug, PartialEq)]
struct RawFix {
    stamp_ns: i64,
    /// Latitude and longitude, degrees; or m east and north.
    at: [f64; 2],
    /// Altitude above the ellipsoid, m; 0 where the log has none.
    altitude_m: f64,
    /// Standard deviation of a coordinate, m; not above zero where the log has none.
    sigma_m: f64,
}

impl RawFix {
    fn geographic(&self) -> Geographic {
        Geographic {
            latitude_deg: self.at[0],
            longitude_deg: self.at[1],
        }
    }
}

impl Raw {
    fn leave_out(&mut self, line: usize) {
        if self.unreadable == 0 {
            self.first_unreadable = line;
        }
        self.unreadable += 1;
    }
}
