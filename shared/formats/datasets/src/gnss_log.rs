//! The log of a GNSS receiver as a file (a table as CSV, or a trajectory as TUM), or in a bag.

mod faults;

use std::{
    io::{self, Read, Seek, SeekFrom},
    path::{Path, PathBuf},
};

pub use faults::GnssFaults;

use csv::StringRecord;
use gyre_geometry::samples::{BagFixes, GnssConfig, GnssFix, LocalPlane, RawFix};

use crate::{
    LogError,
    header::{Header, Sign, Stamp},
    logs, parse_seconds,
    table::{Columns, Raw, Rows},
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
            if path.extension().is_some_and(|ending| ending == "tum") {
                return Ok((parse_tum(&logs::text(path, OF)?), true));
            }
            let rows = logs::rows::<FixColumns>(path, OF)?;
            return Ok((rows.raw, rows.columns.is_plane));
        }
        // The lines of the place and of the first two rows of its covariance.
        let fix = |stamp_ns, [at, first, second]: [[f64; 3]; 3]| RawFix {
            stamp_ns,
            at: [at[0], at[1]],
            altitude_m: at[2],
            sigma_m: RawFix::sigma_of([first[0], second[1]]),
            ..RawFix::default()
        };
        Ok((logs::gps_imu_twist(path, [0, 1, 2], fix)?, false))
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
    rows: Option<Rows<FixColumns>>,
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

/// Columns of MulRan `gps.csv`, which has no header: stamp (ns), latitude, longitude, altitude,
/// covariance (3 x 3, m², east first).
const MULRAN: usize = 13;

/// Names of columns: of latitude, longitude, east, north, altitude.
const LATITUDE: &str = "latitude_deg latitude lat lat_deg";
const LONGITUDE: &str = "longitude_deg longitude lon lng lon_deg";
const EAST: &str = "east_m easting_m easting east";
const NORTH: &str = "north_m northing_m northing north";
const ALTITUDE: &str = "altitude_m altitude alt";
/// The hemispheres of latitudes and longitudes without a sign.
const NORTH_OR_SOUTH: Sign = Sign {
    names: "n_s ns n_s_indicator ns_indicator lat_ref latitude_ref lat_dir latitude_dir lat_ns lat_hemisphere latitude_hemisphere hemisphere",
    plus: "n north",
    minus: "s south",
};
const EAST_OR_WEST: Sign = Sign {
    names: "e_w ew e_w_indicator ew_indicator lon_ref longitude_ref lon_dir longitude_dir lon_ew lon_hemisphere longitude_hemisphere",
    plus: "e east",
    minus: "w west",
};
/// Standard deviation along each axis; of Oxford the one along north, beside that along east.
const SIGMA: &str = "sigma_m sigma latitude_sigma";
const SIGMA_EAST: &str = "longitude_sigma";
/// ROS: the status of a fix, and the number where it is unknown.
const STATUS: &str = "status_status";
const STATUS_UNKNOWN: &str = "-2";

const TUM: &str = "a line has seconds, x and y, with spaces between";
const REMEDY: &str = "the first row must name the columns, as in `stamp_ns,latitude_deg,longitude_deg,sigma_m` or `stamp_ns,east_m,north_m,sigma_m` (also stamp_us, stamp_s)";

#[derive(Clone)]
struct FixColumns {
    stamp: Stamp,
    at: [usize; 2],
    signs: [Option<(usize, &'static Sign)>; 2],
    is_plane: bool,
    altitude: Option<usize>,
    /// The uncertainty along both axes, whose mean square is used: variances, otherwise standard
    /// deviations.
    sigma: Option<(bool, [usize; 2])>,
    status: Option<usize>,
}

fn parse_tum(text: &str) -> Raw<RawFix> {
    let mut raw = Raw::of(Vec::new());
    for (number, line) in text.lines().enumerate() {
        if line.trim().is_empty() || line.starts_with('#') {
            continue;
        }
        let mut fields = line.split_whitespace();
        let stamp_ns = fields.next().and_then(parse_seconds);
        let mut coordinate = || fields.next()?.parse().ok();
        match (stamp_ns, coordinate(), coordinate()) {
            (Some(stamp_ns), Some(x), Some(y)) => raw.entries.push(RawFix {
                stamp_ns,
                at: [x, y],
                ..RawFix::default()
            }),
            _ => raw.unreadable.add(1, number + 1, || TUM.to_owned()),
        }
    }
    raw
}

impl Columns for FixColumns {
    type Entry = RawFix;

    fn by_number(columns: usize) -> Result<Self, String> {
        match columns {
            MULRAN => Ok(Self {
                stamp: Stamp::first(false),
                at: [1, 2],
                signs: [None, None],
                is_plane: false,
                altitude: Some(3),
                sigma: Some((true, [4, 8])),
                status: None,
            }),
            _ => Err(format!(
                "its {columns} columns have no names, and only the {MULRAN} of MulRan's gps.csv are known without: {REMEDY}"
            )),
        }
    }

    fn by_names(header: &Header) -> Result<Self, String> {
        let on_earth = header.find(LATITUDE).zip(header.find(LONGITUDE));
        let in_plane = header.find(EAST).zip(header.find(NORTH));
        let missing = |what| format!("its columns {} have no {what}: {REMEDY}", header.listed());
        let (a, b) = on_earth.or(in_plane).ok_or_else(|| missing("positions"))?;
        let signs = [&NORTH_OR_SOUTH, &EAST_OR_WEST];
        let east = header.find(SIGMA_EAST);
        let sigma = header.find(SIGMA).or(east);
        Ok(Self {
            stamp: header.stamp().ok_or_else(|| missing("stamps"))?,
            at: [a, b],
            signs: signs
                .map(|sign| Some((header.find(sign.names)?, sign)).filter(|_| on_earth.is_some())),
            is_plane: on_earth.is_none(),
            altitude: header.find(ALTITUDE),
            sigma: sigma.map(|north| (false, [north, east.unwrap_or(north)])),
            status: header.find(STATUS),
        })
    }

    fn is_unmeasured(&self, row: &StringRecord) -> bool {
        self.stamp.ns(row).is_some() && self.at.iter().all(|at| row.get(*at) == Some(""))
    }

    fn entry(&self, row: &StringRecord) -> Option<RawFix> {
        let number = |column: usize| row.get(column)?.parse::<f64>().ok();
        let coordinate = |axis: usize| {
            let value = number(self.at[axis])?;
            match self.signs[axis] {
                Some((column, sign)) => sign.apply(value, row.get(column)?),
                None => Some(value),
            }
        };
        // A field is blank if the receiver does not know the value.
        let known = |column: usize| match row.get(column)? {
            "" => Some(f64::NAN),
            text => text.parse::<f64>().ok(),
        };
        Some(RawFix {
            stamp_ns: self.stamp.ns(row)?,
            at: [coordinate(0)?, coordinate(1)?],
            altitude_m: self.altitude.map_or(Some(0.0), known)?,
            sigma_m: match self.sigma {
                None => 0.0,
                Some((true, [a, b])) => RawFix::sigma_of([known(a)?, known(b)?]),
                // A negative one has a negative square.
                Some((false, [a, b])) => {
                    RawFix::sigma_of([known(a)?, known(b)?].map(|it| it * it.abs()))
                }
            },
            status_is_unknown: self.status.and_then(|it| row.get(it)) == Some(STATUS_UNKNOWN),
        })
    }
}
