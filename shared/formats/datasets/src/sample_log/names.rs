//! The columns of each kind of log by their names, or by their number.

use std::f64::consts::PI;

use gyre_geometry::samples::{Sample, SampleKind};

use super::columns::{Columns, Counts, Read};
use crate::header::{Header, Sign, Stamp, endings, unit_of};

pub(super) fn missing(header: &Header, what: &str, hint: &str) -> String {
    format!("its columns {} have no {what}: {hint}", header.listed())
}

fn unnamed(columns: usize, known: usize, of: &str, remedy: &str) -> Result<Columns, String> {
    Err(format!(
        "its {columns} columns have no names, and only the {known} of {of} are known without: {remedy}"
    ))
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

const RATES_REMEDY: &str = "the first row must name the columns, as in `stamp_ns,gyro_x_radps,gyro_y_radps,gyro_z_radps` (also stamp_us, stamp_s; _degps)";

fn rates_and_accelerations(stamp: Stamp, rates: Vector, others: Option<Vector>) -> Columns {
    let (rates, unit) = rates;
    let columns = Columns::of(stamp).with(0, rates, Read::Number(unit.unwrap_or(1.0)));
    match others {
        Some((others, unit)) => columns.with(3, others, Read::NumberIfAny(unit.unwrap_or(1.0))),
        None => columns,
    }
}

pub(super) fn rates(header: &Header) -> Result<Columns, String> {
    let names = header.names();
    if names == FOMO {
        let accelerations = Some(([4, 5, 6], None));
        let stamp = Stamp::first(true);
        return Ok(rates_and_accelerations(
            stamp,
            ([1, 2, 3], None),
            accelerations,
        ));
    }
    let Some(rates) = vector(header, RATES, &RATE_UNITS) else {
        let hint = match header.find("ins_status") {
            Some(_) => "the INS logs of Oxford and OORD have positions and attitudes alone",
            None => RATES_REMEDY,
        };
        return Err(missing(header, "angular rates about three axes", hint));
    };
    let stamp = header.stamp();
    let stamp = stamp.ok_or_else(|| missing(header, "stamps", RATES_REMEDY))?;
    let accelerations = vector(header, ACCELERATIONS, &ACCELERATION_UNITS);
    let unit_is_assumed = rates.1.is_none() && !KNOWN.iter().any(|known| names == *known);
    let mut columns = rates_and_accelerations(stamp, rates, accelerations);
    columns.form.unit_is_assumed = unit_is_assumed;
    Ok(columns)
}

/// MulRan `xsens_imu.csv` has no header: stamp (ns), quaternion, Euler angles, rates,
/// accelerations, magnetic field. Its first version had no rates.
pub(super) fn unnamed_rates(columns: usize) -> Result<Columns, String> {
    match columns {
        17 => Ok(rates_and_accelerations(
            Stamp::first(false),
            ([8, 9, 10], None),
            Some(([11, 12, 13], None)),
        )),
        8 => Err("as the first version of MulRan's xsens_imu.csv it has orientations and no angular rates, but 17 columns have them: download the recording anew".to_owned()),
        _ => unnamed(columns, 17, "MulRan's xsens_imu.csv", RATES_REMEDY),
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

/// The accelerations are zero if one of them is not finite.
pub(super) fn turning(stamp_ns: i64, mut values: [f64; 6]) -> Sample {
    if values[3..].iter().any(|value| !value.is_finite()) {
        values[3..].fill(0.0);
    }
    Sample::of(SampleKind::Gyro, stamp_ns, values)
}

const SPEEDS: &str = "speed wheel_speed vehicle_speed velocity v vx linear_x";
const SPEED_UNITS: [(&str, f64); 3] = [
    ("_mps _m_s _m_per_s", 1.0),
    ("_kmh _km_h _kmph _kph", 1.0 / 3.6),
    ("_mph", 0.44704),
];

const SPEED_REMEDY: &str = "the first row must name the columns, as in `stamp_ns,speed_m_s` (also stamp_us, stamp_s; speed_km_h; ticks, distance_m)";

/// Columns with the direction of a speed that has no sign.
const DIRECTIONS: &str =
    "direction driving_direction travel_direction reverse is_reverse reversing";

pub(super) fn speed(header: &Header) -> Result<Columns, String> {
    if header.find(DIRECTIONS).is_some() {
        let columns = header.listed();
        return Err(format!(
            "its columns {columns} have a direction: write what goes backwards with a minus, and remove the direction"
        ));
    }
    let missing = |what| missing(header, what, SPEED_REMEDY);
    let speed = header.first(|name| unit_of(name, SPEEDS, &SPEED_UNITS));
    let (speed, unit) = speed.ok_or_else(|| missing("speed"))?;
    let stamp = header.stamp().ok_or_else(|| missing("stamps"))?;
    let mut columns = Columns::of(stamp).with(0, [speed], Read::Number(unit.unwrap_or(1.0)));
    columns.form.unit_is_assumed = unit.is_none();
    Ok(columns)
}

/// Names of the ticks of one wheel, or of an axle.
const TICKS: &str = "ticks pulses wheel_ticks encoder_ticks";
/// Names of the ticks of two wheels of an axle; their mean is used.
const LEFT_AND_RIGHT: [[&str; 2]; 3] = [
    ["left_ticks", "right_ticks"],
    ["ticks_left", "ticks_right"],
    ["left_count", "right_count"],
];
const METRES: &str = "distance_m odometer_m mileage_m";

/// The columns of an encoder or an odometer, which counts ticks or metres since some time.
pub(super) fn counts(header: &Header) -> Option<Columns> {
    let one = |names: &str| header.find(names).map(|column| [column; 2]);
    let both = || {
        let mut pairs = LEFT_AND_RIGHT.iter();
        pairs.find_map(|[left, right]| Some([header.find(left)?, header.find(right)?]))
    };
    let metres = one(METRES);
    let counts = metres.or_else(both).or_else(|| one(TICKS))?;
    let has_direction = header.find(DIRECTIONS).is_some();
    let mut columns = Columns::of(header.stamp()?).with(0, counts, Read::Number(1.0));
    columns.form.counts = Some(metres.map_or(Counts::Ticks, |_| Counts::Metres));
    (!has_direction).then_some(columns)
}

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

const POSITIONS_REMEDY: &str = "the first row must name the columns, as in `stamp_ns,latitude_deg,longitude_deg,sigma_m` or `stamp_ns,east_m,north_m,sigma_m` (also stamp_us, stamp_s)";

pub(super) fn positions(header: &Header) -> Result<Columns, String> {
    let on_earth = header.find(LATITUDE).zip(header.find(LONGITUDE));
    let in_plane = header.find(EAST).zip(header.find(NORTH));
    let missing = |what| missing(header, what, POSITIONS_REMEDY);
    let (a, b) = on_earth.or(in_plane).ok_or_else(|| missing("positions"))?;
    let stamp = header.stamp().ok_or_else(|| missing("stamps"))?;
    let sign = |sign: &'static Sign| match header.find(sign.names).filter(|_| on_earth.is_some()) {
        Some(column) => Read::Signed(column, sign),
        None => Read::Number(1.0),
    };
    let east = header.find(SIGMA_EAST);
    let sigma = header.find(SIGMA).or(east);
    let sigma = sigma.map(|north| [north, east.unwrap_or(north)]);
    let mut columns = Columns::of(stamp)
        .with(0, [a], sign(&NORTH_OR_SOUTH))
        .with(1, [b], sign(&EAST_OR_WEST))
        .with(2, header.find(ALTITUDE), Read::OrBlank(|it| it))
        // A negative deviation has a negative square.
        .with(
            3,
            sigma.into_iter().flatten(),
            Read::OrBlank(|it| it * it.abs()),
        )
        .with(5, header.find(STATUS), Read::Is(STATUS_UNKNOWN));
    columns.form.is_plane = on_earth.is_none();
    Ok(columns)
}

/// MulRan `gps.csv` has no header: stamp (ns), latitude, longitude, altitude, covariance (3 x 3,
/// m², east first).
pub(super) fn unnamed_positions(columns: usize) -> Result<Columns, String> {
    match columns {
        13 => Ok(Columns::of(Stamp::first(false))
            .with(0, [1, 2], Read::Number(1.0))
            .with(2, [3, 4, 8], Read::OrBlank(|it| it))),
        _ => unnamed(columns, 13, "MulRan's gps.csv", POSITIONS_REMEDY),
    }
}

/// A fix of a place, an altitude, variances along north and east, and 1 if its status is unknown.
pub(super) fn fix(
    stamp_ns: i64,
    [a, b, altitude_m, north_m2, east_m2, is_unknown]: [f64; 6],
) -> Sample {
    let sigma_m = Sample::sigma_of([north_m2, east_m2]);
    let mut fix = Sample::fix(stamp_ns, [a, b], altitude_m, sigma_m);
    fix.values[4] = is_unknown;
    fix
}
