//! Tables as CSV, and trajectories as TUM.

use std::path::Path;

use csv::StringRecord;
use gyre_storage as storage;

use gyre_samples::RawFix;

use super::{GnssLogError, Raw};
use crate::gyro_log::{
    columns::{StampUnit, plain, stamp_unit},
    table::reader,
};
use crate::parse_seconds;
use gyre_storage::quoted;

/// The largest file: a day of fixes at 100 Hz has 1 GB.
const MAX_BYTES: u64 = 4 << 30;

/// Columns of MulRan `gps.csv`, which has no header: stamp (ns), latitude, longitude, altitude,
/// covariance (3 x 3, m², east first).
const MULRAN: usize = 13;

/// Names of columns: of latitude, longitude, east, north, altitude.
const LATITUDE: [&str; 3] = ["latitude_deg", "latitude", "lat"];
const LONGITUDE: [&str; 4] = ["longitude_deg", "longitude", "lon", "lng"];
const EAST: [&str; 4] = ["east_m", "easting_m", "easting", "east"];
const NORTH: [&str; 4] = ["north_m", "northing_m", "northing", "north"];
const ALTITUDE: [&str; 3] = ["altitude_m", "altitude", "alt"];
/// Standard deviation along each axis; of Oxford the one along north, beside that along east.
const SIGMA: [&str; 3] = ["sigma_m", "sigma", "latitude_sigma"];
const SIGMA_EAST: &str = "longitude_sigma";

/// The remedy, for messages.
const REMEDY: &str = "the first row must name the columns, as in `stamp_ns,latitude_deg,longitude_deg,sigma_m` or `stamp_ns,east_m,north_m,sigma_m` (also stamp_us, stamp_s)";

/// Where a table has what.
struct Columns {
    stamp: (usize, StampUnit),
    at: [usize; 2],
    is_plane: bool,
    altitude: Option<usize>,
    sigma: Sigma,
}

/// Where a row has the uncertainty.
enum Sigma {
    None,
    /// Standard deviations, of which the mean square counts.
    Deviations(Vec<usize>),
    /// Variances.
    Variances([usize; 2]),
}

pub(super) fn read(path: &Path) -> Result<Raw, GnssLogError> {
    let text = storage::read_text(path, MAX_BYTES).map_err(|source| GnssLogError::Io {
        path: path.to_owned(),
        source,
    })?;
    let is_tum = path.extension().is_some_and(|ending| ending == "tum");
    let raw = match is_tum {
        true => Ok(parse_tum(&text)),
        false => parse(&text),
    };
    raw.map_err(|reason| GnssLogError::Unknown {
        path: path.to_owned(),
        reason,
    })
}

fn parse(text: &str) -> Result<Raw, String> {
    let mut reader = reader(text);
    let mut row = StringRecord::new();
    let mut next = |row: &mut StringRecord| reader.read_record(row).map_err(|e| e.to_string());
    if !next(&mut row)? {
        return Err("it is empty".to_owned());
    }
    let is_fix = row.iter().all(|field| field.parse::<f64>().is_ok());
    let columns = match is_fix {
        true => Columns::by_number(row.len())?,
        false => Columns::by_names(row.iter().map(plain).collect())?,
    };
    let count = row.len();
    let mut raw = Raw {
        is_plane: columns.is_plane,
        ..Raw::default()
    };
    // Without a header the first row is a fix.
    let mut goes_on = is_fix || next(&mut row)?;
    while goes_on {
        let is_whole = row.len() == count;
        match columns.fix(&row).filter(|_| is_whole) {
            Some(fix) => raw.rows.push(fix),
            None if is_whole && columns.has_no_fix(&row) => raw.without_fix += 1,
            None => raw.leave_out(row.position().map_or(0, |at| at.line() as usize)),
        }
        goes_on = next(&mut row)?;
    }
    Ok(raw)
}

/// Reads the times and places of a trajectory: seconds, x, y and more.
fn parse_tum(text: &str) -> Raw {
    let mut raw = Raw {
        is_plane: true,
        ..Raw::default()
    };
    for (number, line) in text.lines().enumerate() {
        if line.trim().is_empty() || line.starts_with('#') {
            continue;
        }
        let mut fields = line.split_whitespace();
        let stamp_ns = fields.next().and_then(parse_seconds);
        let mut coordinate = || fields.next()?.parse().ok();
        match (stamp_ns, coordinate(), coordinate()) {
            (Some(stamp_ns), Some(x), Some(y)) => raw.rows.push(RawFix {
                stamp_ns,
                at: [x, y],
                altitude_m: 0.0,
                sigma_m: 0.0,
            }),
            _ => raw.leave_out(number + 1),
        }
    }
    raw
}

impl Columns {
    fn by_number(columns: usize) -> Result<Self, String> {
        match columns {
            MULRAN => Ok(Self {
                stamp: (0, StampUnit::Ns(1)),
                at: [1, 2],
                is_plane: false,
                altitude: Some(3),
                sigma: Sigma::Variances([4, 8]),
            }),
            _ => Err(format!(
                "its {columns} columns have no names, and only the {MULRAN} of MulRan's gps.csv are known without: {REMEDY}"
            )),
        }
    }

    fn by_names(names: Vec<String>) -> Result<Self, String> {
        let find = |wanted: &[&str]| {
            let mut wanted = wanted.iter();
            wanted.find_map(|wanted| names.iter().position(|name| name == wanted))
        };
        let stamp = names.iter().enumerate();
        let stamp = stamp.filter_map(|(k, name)| Some((k, stamp_unit(name)?)));
        let on_earth = find(&LATITUDE).zip(find(&LONGITUDE));
        let in_plane = find(&EAST).zip(find(&NORTH));
        let Some((a, b)) = on_earth.or(in_plane) else {
            let columns = quoted(&names.join(","));
            return Err(format!("its columns {columns} have no positions: {REMEDY}"));
        };
        let deviations = [find(&SIGMA), find(&[SIGMA_EAST])];
        let deviations: Vec<usize> = deviations.into_iter().flatten().collect();
        Ok(Self {
            stamp: stamp
                .into_iter()
                .next()
                .ok_or_else(|| format!("it has no column of stamps: {REMEDY}"))?,
            at: [a, b],
            is_plane: on_earth.is_none(),
            altitude: find(&ALTITUDE),
            sigma: match deviations.is_empty() {
                true => Sigma::None,
                false => Sigma::Deviations(deviations),
            },
        })
    }

    /// Returns whether a row has a stamp, and no place beside it.
    fn has_no_fix(&self, row: &StringRecord) -> bool {
        let (column, unit) = self.stamp;
        let is_stamped = row.get(column).and_then(|stamp| unit.ns(stamp)).is_some();
        is_stamped && self.at.iter().all(|at| row.get(*at) == Some(""))
    }

    /// Reads a row; `None` if a field is missing or no number. `nan` is one.
    fn fix(&self, row: &StringRecord) -> Option<RawFix> {
        let (column, unit) = self.stamp;
        let number = |column: usize| row.get(column)?.parse::<f64>().ok();
        let mean = |columns: &[usize], power: i32| {
            let squares = columns
                .iter()
                .map(|it| number(*it).map(|it| it.powi(power)));
            let sum = squares.sum::<Option<f64>>()?;
            Some((sum / columns.len() as f64).sqrt())
        };
        Some(RawFix {
            stamp_ns: unit.ns(row.get(column)?)?,
            at: [number(self.at[0])?, number(self.at[1])?],
            altitude_m: match self.altitude {
                Some(column) => number(column)?,
                None => 0.0,
            },
            sigma_m: match &self.sigma {
                Sigma::None => 0.0,
                Sigma::Deviations(columns) => mean(columns, 2)?,
                Sigma::Variances(columns) => mean(columns, 1)?,
            },
        })
    }
}
