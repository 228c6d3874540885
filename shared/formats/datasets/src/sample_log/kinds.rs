//! The kinds of logs, one row for each: the places of the log, the readers of its columns, the
//! plausible values, and the words.

use std::f64::consts::{FRAC_PI_2, TAU};

use gyre_geometry::{
    samples::{Sample, SampleKind},
    wrap_angle,
};

use super::{
    columns::{Columns, Read},
    faults::{FaultWords, OF_FIXES, OF_SAMPLES},
    names::{
        counts, fix, missing, positions, rates, speed, turning, unnamed_positions, unnamed_rates,
    },
};
use crate::header::Header;

/// The change from one sample to another.
pub(crate) type Change = fn(&Sample, &Sample) -> f64;

#[derive(Clone, Copy)]
pub(crate) struct Kind {
    pub of: SampleKind,
    /// The sensor in words: at the begin of a finding, with an article, and after one.
    pub title: &'static str,
    pub one: &'static str,
    pub name: &'static str,
    /// A measurement, in the plural.
    pub samples: &'static str,
    /// The advice to use a log that was found: the beginning of a sentence.
    pub uses: &'static str,
    /// Logs relative to the root of a dataset, in order of precedence.
    pub places: &'static [&'static str],
    /// The log that a ground truth was computed from.
    pub in_truth: Option<&'static str>,
    /// The ending of the log that a recording has, in place of the recording's.
    pub of_recording: Option<&'static str>,
    /// The lines of RADIATE's `GPS_IMU_Twist` with the values, and the places in them.
    pub twist: &'static [(usize, usize)],
    pub by_names: fn(&Header) -> Result<Columns, String>,
    pub by_number: fn(usize) -> Result<Columns, String>,
    /// Makes a sample of the values that a log has.
    pub sample: fn(i64, [f64; 6]) -> Sample,
    /// The number of first values that every sample has. If all are blank, nothing was measured,
    /// where `has_blanks`.
    pub values: usize,
    pub has_blanks: bool,
    /// The largest of them, and what to do where many are larger.
    pub most: f64,
    pub beyond: &'static str,
    pub faults: &'static [FaultWords],
    /// Words of the faults: the values, those beyond `most`, and the unit that is assumed.
    pub value_words: &'static str,
    pub absurd: &'static str,
    pub unit: &'static str,
    /// The change from one sample to another that cannot be faster than a vehicle, and by how much
    /// it can be in a second.
    pub changes: Option<(Change, f64)>,
}

impl Kind {
    pub fn of(of: SampleKind) -> &'static Self {
        match of {
            SampleKind::Gyro => &GYRO,
            SampleKind::Wheels => &WHEELS,
            SampleKind::Gnss => &GNSS,
            SampleKind::Heading => &HEADING,
        }
    }
}

const GYRO: Kind = Kind {
    of: SampleKind::Gyro,
    title: "Gyro",
    one: "a gyro",
    name: "gyro",
    samples: "samples",
    uses: "`gyre calibrate` finds its axis and how late its clock is, and gyro.kind = \"auto\"",
    places: &[
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
    ],
    // Of Boreas, the log of the INS.
    in_truth: Some("applanix/imu.csv"),
    of_recording: None,
    twist: &[(5, 0), (5, 1), (5, 2), (6, 0), (6, 1), (6, 2)],
    by_names: rates,
    by_number: unnamed_rates,
    sample: turning,
    values: 3,
    has_blanks: false,
    most: 10.0,
    beyond: "have rates beyond 10 rad/s, at which no vehicle turns: if they are in deg/s, name the columns so, as gyro_z_degps",
    faults: OF_SAMPLES,
    value_words: "rates",
    absurd: "rates beyond 10 rad/s, at which no vehicle turns",
    unit: "of the rates: rad/s is assumed; `gyre calibrate` tells deg/s by its scale",
    // The largest yaw acceleration of a vehicle, rad/s²: tyres that hold as much as they carry turn
    // one with the wheelbase L, whose mass is spread over it, by 2 g / L. No vehicle with a radar
    // is shorter than half a metre.
    changes: Some((|from, to| to.values[2] - from.values[2], 40.0)),
};

pub(super) const WHEELS: Kind = Kind {
    of: SampleKind::Wheels,
    title: "Wheels",
    one: "the wheels",
    name: "wheels",
    uses: "`gyre calibrate` finds how late its clock is, and wheels.kind = \"auto\"",
    places: &["wheels.csv", "wheel_speed.csv", "speed.csv", "odometer.csv"],
    in_truth: None,
    twist: &[],
    by_names: |header| speed(header).or_else(|reason| counts(header).ok_or(reason)),
    by_number: |columns| {
        Err(format!(
            "its {columns} columns have no names: the first row must name them"
        ))
    },
    sample: |stamp_ns, values| Sample::of(SampleKind::Wheels, stamp_ns, values),
    values: 1,
    most: MOST_MPS,
    beyond: "have speeds beyond 100 m/s: if they are in km/h, name the column so, as speed_km_h",
    value_words: "speeds",
    absurd: "speeds beyond 100 m/s, at which no vehicle drives",
    unit: "of the speed: m/s is assumed; `gyre calibrate` tells km/h by its scale",
    // m/s²: twice as much as tyres brake that hold as much as they carry.
    changes: Some((|from, to| to.values[0] - from.values[0], 20.0)),
    ..GYRO
};

pub(super) const MOST_MPS: f64 = 100.0;

const GNSS: Kind = Kind {
    of: SampleKind::Gnss,
    title: "GNSS",
    one: "a GNSS receiver",
    name: "GNSS receiver",
    samples: "fixes",
    uses: "with slam.kind = \"graph\", gnss.kind = \"auto\"",
    places: &[
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
    ],
    in_truth: None,
    of_recording: Some("gnss.csv"),
    twist: &[(0, 0), (0, 1), (0, 2), (1, 0), (2, 1)],
    by_names: positions,
    by_number: unnamed_positions,
    sample: fix,
    values: 2,
    has_blanks: true,
    most: f64::MAX,
    faults: OF_FIXES,
    changes: None,
    ..GYRO
};

const HEADING: Kind = Kind {
    of: SampleKind::Heading,
    title: "Heading",
    one: "absolute headings",
    name: "receiver of headings",
    uses: "heading.kind = \"auto\"",
    places: &["heading.csv"],
    by_names: heading,
    sample: |stamp_ns, values| Sample::of(SampleKind::Heading, stamp_ns, values),
    most: TAU,
    beyond: "are beyond a whole turn: if they are in degrees, name the column so, as heading_deg or yaw_deg",
    value_words: "headings",
    absurd: "headings beyond a whole turn",
    // As for the rates of a gyro, rad/s.
    changes: Some((|from, to| wrap_angle(to.values[0] - from.values[0]), 10.0)),
    ..WHEELS
};

/// The heading of a number, rad.
type Angle = fn(f64) -> f64;

/// The columns of headings: clockwise from true north, as receivers state them, or
/// counter-clockwise from east.
fn heading(header: &Header) -> Result<Columns, String> {
    let forms: [(&str, Angle); 3] = [
        ("heading_deg", |deg| FRAC_PI_2 - deg.to_radians()),
        ("yaw_rad", |rad| rad),
        ("yaw_deg", f64::to_radians),
    ];
    let remedy = "the first row must name the columns, as in `stamp_ns,heading_deg` (clockwise from north), or yaw_rad, yaw_deg (counter-clockwise from east)";
    let missing = |what| missing(header, what, remedy);
    let mut forms = forms.into_iter();
    let found = forms.find_map(|(name, of)| Some((header.find(name)?, of)));
    let (column, of) = found.ok_or_else(|| missing("heading"))?;
    let stamp = header.stamp().ok_or_else(|| missing("stamps"))?;
    Ok(Columns::of(stamp).with(0, [column], Read::OrBlank(of)))
}
