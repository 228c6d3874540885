//! The log of a GNSS receiver as a file, or in a bag.

mod faults;
mod table;

use std::{
    io::{self, Read, Seek, SeekFrom},
    path::{Path, PathBuf},
};

pub use faults::GnssFaults;

use gyre_geometry::samples::{BagFixes, GnssConfig, GnssFix, LocalPlane, RawFix};

use crate::{
    LogError, gps_imu_twist, logs,
    table::{Raw, Rows},
};

const OF: &str = "gnss";

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
    /// The plane of the fixes, which touches the earth at the first of them; `None` if the log has
    /// coordinates in a plane of its own.
    pub plane: Option<LocalPlane>,
    pub faults: GnssFaults,
    pub path: PathBuf,
    /// The topic in the bag; `None` of a file.
    pub topic: Option<String>,
    /// The reason why the log of a live receiver has no fixes; in any other log that is an error.
    pub unusable: Option<String>,
}

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
    /// Reads a log. The first row, or the number of columns, determines the format.
    pub fn read(path: &Path) -> Result<Self, LogError> {
        let (raw, is_plane) = Self::raw(path)?;
        match raw.unreadable.are_most(raw.count()) {
            Some(reason) => Err(LogError::unusable(OF, path, reason)),
            None => Self::usable(raw, is_plane, path),
        }
    }

    /// Returns the fixes of a log as they stand there, and whether they are m east and north, and
    /// not degrees of latitude and longitude.
    fn raw(path: &Path) -> Result<(Raw<RawFix>, bool), LogError> {
        if !path.is_dir() {
            return table::read(path);
        }
        // The lines of the place and of the first two rows of its covariance.
        let fix = |stamp_ns, [at, first, second]: [[f64; 3]; 3]| RawFix {
            stamp_ns,
            at: [at[0], at[1]],
            altitude_m: at[2],
            sigma_m: RawFix::sigma_of([first[0], second[1]]),
            ..RawFix::default()
        };
        Ok((gps_imu_twist::read(path, [0, 1, 2], fix)?, false))
    }

    /// Returns all fixes of a log as one table.
    pub fn copy_of(path: &Path) -> Result<String, LogError> {
        let (raw, is_plane) = Self::raw(path)?;
        Ok(Self::table(&raw.entries, is_plane))
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

    /// Reads the log of a live receiver during a run. Lines without a fix are allowed. A run
    /// without usable fixes continues without them, and keeps the reason.
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

    pub fn of(fixes: BagFixes, bag: &Path) -> Result<Self, LogError> {
        let raw = Raw {
            unmeasured: fixes.without_fix,
            ..Raw::of(fixes.fixes)
        };
        Ok(Self {
            topic: Some(fixes.topic),
            ..Self::usable(raw, false, bag)?
        })
    }

    /// Returns the log that lies beside the scans of a dataset, which may also be named by the
    /// folder of the images; of the first file of a recording its own, if it has one.
    pub fn find(folder: &Path) -> Result<PathBuf, LogError> {
        let own = Self::of_recording(folder);
        // The first file itself may have been moved away.
        if !folder.is_dir() && own.is_file() {
            return Ok(own);
        }
        // For a bag or a different recording in one file, the folder of the file.
        let folder = match folder.is_file() {
            true => folder.parent().unwrap_or(folder),
            false => folder,
        };
        logs::find(folder, OF, &PLACES)
    }

    /// Returns the fixes on the radar's clock, with the configured uncertainty where the log has
    /// none.
    pub fn on_radar(&self, config: &GnssConfig) -> Vec<GnssFix> {
        let late_ns = (config.delay_s * 1e9).round() as i64;
        let fixes = self.fixes.iter().map(|fix| GnssFix {
            stamp_ns: fix.stamp_ns.saturating_sub(late_ns),
            east_m: fix.east_north_m[0],
            north_m: fix.east_north_m[1],
            sigma_m: fix.sigma_m.unwrap_or(config.sigma_m),
        });
        fixes.collect()
    }

    fn usable(raw: Raw<RawFix>, is_plane: bool, path: &Path) -> Result<Self, LogError> {
        let log = Self::examined(raw, is_plane, path);
        match log.unusable {
            Some(reason) => Err(LogError::Unusable(reason)),
            None => Ok(log),
        }
    }

    /// Examines the fixes; a log without a usable fix has the reason.
    fn examined(raw: Raw<RawFix>, is_plane: bool, path: &Path) -> Self {
        let all = raw.count();
        let (fixes, plane, faults) = faults::examine(raw, is_plane);
        let why = || LogError::unusable(OF, path, faults.without_usable(all)).to_string();
        Self {
            unusable: fixes.is_empty().then(why),
            fixes,
            plane,
            faults,
            path: path.to_owned(),
            topic: None,
        }
    }
}

/// The fixes that a live receiver has sent so far: each row of their log is read once.
pub struct ReceivedFixes {
    path: PathBuf,
    end: u64,
    rows: Option<Rows<table::FixColumns>>,
}

impl ReceivedFixes {
    pub fn new(path: &Path) -> Self {
        Self {
            path: path.to_owned(),
            end: 0,
            rows: None,
        }
    }

    pub fn read_on(&mut self) -> Result<(), LogError> {
        let bytes = self.appended();
        let bytes = bytes.map_err(|source| LogError::unreadable(OF, &self.path, source))?;
        let text = String::from_utf8_lossy(&bytes);
        match &mut self.rows {
            Some(rows) => rows.go_on(&text),
            None => {
                let rows = Rows::of(&text);
                self.rows = Some(rows.map_err(|e| LogError::unknown(OF, &self.path, e))?);
            }
        }
        self.end += bytes.len() as u64;
        Ok(())
    }

    pub fn count(&self) -> usize {
        self.rows.as_ref().map_or(0, |rows| rows.raw.entries.len())
    }

    pub fn log(&self) -> GnssLog {
        let rows = self.rows.clone();
        let (raw, is_plane) = rows.map_or((Raw::of(Vec::new()), false), |rows| {
            (rows.raw, rows.columns.is_plane)
        });
        GnssLog::examined(raw, is_plane, &self.path)
    }

    fn appended(&self) -> io::Result<Vec<u8>> {
        let mut file = gyre_storage::open(&self.path)?;
        file.seek(SeekFrom::Start(self.end))?;
        let mut bytes = Vec::new();
        file.read_to_end(&mut bytes)?;
        Ok(bytes)
    }
}
