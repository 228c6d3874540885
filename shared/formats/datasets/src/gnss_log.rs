//! The log of a GNSS receiver as a file, or in a bag.
//!
//! - [`GnssLog`]: where it lies beside the scans of a dataset, and how it is read;
//! - `table`: tables as CSV; `radiate`: the files of RADIATE, one for each fix;
//! - [`ReceivedFixes`]: the growing log of a live receiver;
//! - `faults`: what is wrong with the fixes, and which of them are left out.

mod error;
mod faults;
mod radiate;
mod received;
mod table;

use std::path::{Path, PathBuf};

pub use error::GnssLogError;
pub use faults::GnssFaults;
pub use received::ReceivedFixes;

use gyre_samples::{BagFixes, GnssConfig, GnssFix, LocalPlane, RawFix};

use crate::{gps_imu_twist::has_list, gyro_log::roots, table::Unreadable};

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

/// The ending of a recording's own log, in place of the recording's.
const OF_RECORDING: &str = "gnss.csv";

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
    /// The file, the folder of files, or the bag.
    pub path: PathBuf,
    /// The topic in the bag; `None` of a file.
    pub topic: Option<String>,
    /// The reason why there are no fixes, of what a live receiver has sent; of any other log that
    /// is an error.
    pub unusable: Option<String>,
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
        let raw = Self::raw(path)?;
        if let Some(reason) = raw.unreadable.are_most(raw.count()) {
            let path = path.to_owned();
            return Err(GnssLogError::Unusable { path, reason });
        }
        Self::usable(raw, path)
    }

    fn raw(path: &Path) -> Result<Raw, GnssLogError> {
        match path.is_dir() {
            true => radiate::read(path),
            false => table::read(path),
        }
    }

    /// Returns all fixes of a log as one table.
    ///
    /// # Errors
    /// A log that cannot be read.
    pub fn copy_of(path: &Path) -> Result<String, GnssLogError> {
        let raw = Self::raw(path)?;
        Ok(Self::table(&raw.rows, raw.is_plane))
    }

    /// Returns a table of fixes, m east and north in a plane of their own or degrees on the earth.
    pub fn table(fixes: &[RawFix], is_plane: bool) -> String {
        let at = match is_plane {
            true => "east_m,north_m",
            false => "latitude_deg,longitude_deg",
        };
        let row = |fix: &RawFix| {
            let (ns, [a, b], sigma_m) = (fix.stamp_ns, fix.at, fix.sigma_m.max(0.0));
            format!("{ns},{a},{b},{},{sigma_m}\n", fix.altitude_m)
        };
        let rows: String = fixes.iter().map(row).collect();
        format!("stamp_ns,{at},altitude_m,sigma_m\n{rows}")
    }

    /// Reads what a live receiver has sent during a run, be it among lines that are no fixes. A run
    /// that has got nothing usable goes on without fixes, and with the reason.
    pub fn received(path: &Path) -> Self {
        let mut received = ReceivedFixes::new(path);
        match received.read_on() {
            Ok(()) => received.log(),
            Err(error) => Self {
                path: path.to_owned(),
                unusable: Some(error.to_string()),
                ..Self::default()
            },
        }
    }

    /// Returns where the fixes lie that belong to a recording of a run: beside its first file,
    /// under the same name.
    pub fn of_recording(recording: &Path) -> PathBuf {
        recording.with_extension(OF_RECORDING)
    }

    /// Takes the fixes of this bag.
    ///
    /// # Errors
    /// No usable fix.
    pub fn of(fixes: BagFixes, bag: &Path) -> Result<Self, GnssLogError> {
        let raw = Raw {
            rows: fixes.fixes,
            without_fix: fixes.without_fix,
            ..Raw::default()
        };
        Ok(Self {
            topic: Some(fixes.topic),
            ..Self::usable(raw, bag)?
        })
    }

    /// Returns the log that lies beside the scans of a dataset, which may also be named by the
    /// folder of the images; of the first file of a recording its own, if it has one.
    ///
    /// # Errors
    /// No log.
    pub fn find(folder: &Path) -> Result<PathBuf, GnssLogError> {
        let own = Self::of_recording(folder);
        // The first file itself may have been moved away.
        if !folder.is_dir() && own.is_file() {
            return Ok(own);
        }
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

    fn usable(raw: Raw, path: &Path) -> Result<Self, GnssLogError> {
        match Self::examined(raw, path) {
            (log, None) => Ok(log),
            (_, Some(error)) => Err(error),
        }
    }

    /// Examines the fixes. Returns the log, and what is wrong where none can be used.
    fn examined(raw: Raw, path: &Path) -> (Self, Option<GnssLogError>) {
        let all = raw.count();
        let (fixes, plane, faults) = faults::examine(raw);
        let error = fixes.is_empty().then(|| GnssLogError::Unusable {
            path: path.to_owned(),
            reason: faults.without_usable(all),
        });
        let log = Self {
            fixes,
            plane,
            faults,
            path: path.to_owned(),
            topic: None,
            unusable: None,
        };
        (log, error)
    }
}

/// The fixes of a file as they stand there.
#[derive(Clone, Debug, Default)]
struct Raw {
    rows: Vec<RawFix>,
    /// The coordinates are m east and north, and not degrees of latitude and longitude.
    is_plane: bool,
    unreadable: Unreadable,
    /// Messages or rows in which the receiver had no fix.
    without_fix: usize,
}

impl Raw {
    /// All entries, those that cannot be used too.
    fn count(&self) -> usize {
        (self.rows.len() + self.without_fix).saturating_add(self.unreadable.count)
    }
}
