//! Tables as CSV, and trajectories as TUM.

use std::path::Path;

use csv::StringRecord;
use gyre_geometry::samples::RawFix;

use super::OF;
use crate::{
    LogError,
    header::{Header, Sign, Stamp},
    logs, parse_seconds,
    table::{Columns, Raw},
};

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
pub(super) struct FixColumns {
    stamp: Stamp,
    at: [usize; 2],
    signs: [Option<(usize, &'static Sign)>; 2],
    pub is_plane: bool,
    altitude: Option<usize>,
    /// The uncertainty along both axes, whose mean square is used: variances, otherwise standard
    /// deviations.
    sigma: Option<(bool, [usize; 2])>,
    status: Option<usize>,
}

pub(super) fn read(path: &Path) -> Result<(Raw<RawFix>, bool), LogError> {
    if path.extension().is_some_and(|ending| ending == "tum") {
        return Ok((parse_tum(&logs::text(path, OF)?), true));
    }
    let rows = logs::rows::<FixColumns>(path, OF)?;
    Ok((rows.raw, rows.columns.is_plane))
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
