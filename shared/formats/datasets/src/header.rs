//! The first row of a table: which column has what, by its name.

use std::collections::HashSet;

use csv::StringRecord;
use gyre_storage::quoted;

use crate::{
    dataset::stamp::{MAX_NS, SECOND_NS},
    parse_seconds, stamp_to_ns,
};

/// Tables of sensors have tens of columns.
const MAX_COLUMNS: usize = 1000;

/// Names of the column of stamps that have no unit.
const STAMPS: &str = "timestamp stamp time t gpstime header_stamp utime unix_time tv";
const STAMP_UNITS: [(&str, StampUnit); 4] = [
    ("_ns", StampUnit::Ns(1)),
    ("_us", StampUnit::Ns(1_000)),
    ("_ms", StampUnit::Ns(1_000_000)),
    ("_s _sec _secs _seconds", StampUnit::Seconds),
];
/// Names of whole seconds, and, at the same place of another column's name, of the rest of them in
/// this unit, ns.
const SECONDS: [&str; 4] = ["seconds", "secs", "sec", "s"];
const RESTS: [(&str, i64); 3] = [
    ("nanosec nanosecs nanoseconds nsec nsecs ns", 1),
    ("microseconds usec usecs us", 1_000),
    ("ms", 1_000_000),
];
const UNKNOWN_RATES: &str = "angular_velocity_covariance_0 angular_velocity_covariance0";
/// Columns that state that a row has no measurement, and the number for that.
const UNMEASURED: [(&str, f64); 4] = [
    ("valid is_valid", 0.0),
    // ROS, of a gyro and of fixes.
    (UNKNOWN_RATES, -1.0),
    ("status_status", -1.0),
    // NMEA.
    ("fix_quality", 0.0),
];

/// A column with the sign of another: its names, and its words for plus and minus, with spaces
/// between.
pub(crate) struct Sign {
    pub names: &'static str,
    pub plus: &'static str,
    pub minus: &'static str,
}

impl Sign {
    /// Returns a value with the sign of this word; `None` for another word, or a contradiction.
    pub fn apply(&self, value: f64, word: &str) -> Option<f64> {
        let is_of = |words: &str| words.split(' ').any(|it| it.eq_ignore_ascii_case(word));
        match (is_of(self.minus), is_of(self.plus)) {
            (true, _) => Some(-value.abs()),
            (_, true) => Some(value).filter(|it| *it >= 0.0 || it.is_nan()),
            _ => Some(value).filter(|it| *it == 0.0 || it.is_nan()),
        }
    }
}

pub(crate) struct Header(Vec<String>);

impl Header {
    pub fn of(first: &StringRecord) -> Result<Self, String> {
        let count = first.len();
        if count > MAX_COLUMNS {
            return Err(format!(
                "its first row has {count} columns, and at most {MAX_COLUMNS} are read: remove those that are not needed"
            ));
        }
        let names: Vec<String> = first.iter().map(plain).collect();
        let mut seen = HashSet::new();
        let mut filled = names.iter().filter(|name| !name.is_empty());
        match filled.find(|name| !seen.insert(name.as_str())) {
            Some(name) => Err(format!("two of its columns are named {}", quoted(name))),
            None => Ok(Self(names)),
        }
    }

    /// Returns the column that has the first of these names, with spaces between, that there is.
    pub fn find(&self, names: &str) -> Option<usize> {
        let mut names = names.split(' ');
        names.find_map(|name| self.0.iter().position(|it| it == name))
    }

    /// Returns the first column whose name `meaning` knows, with its meaning.
    pub fn first<T>(&self, meaning: impl Fn(&str) -> Option<T>) -> Option<(usize, T)> {
        let mut names = self.0.iter().enumerate();
        names.find_map(|(column, name)| Some((column, meaning(name)?)))
    }

    pub fn names(&self) -> &[String] {
        &self.0
    }

    pub fn listed(&self) -> String {
        quoted(&self.0.join(","))
    }

    /// Returns the columns that state that a row has no measurement, and the number for that.
    pub fn unmeasured(&self) -> Vec<(usize, f64)> {
        let column = |(name, number): &(&str, f64)| Some((self.find(name)?, *number));
        UNMEASURED.iter().filter_map(column).collect()
    }

    /// Returns where the stamps are; `None` without such a column.
    pub fn stamp(&self) -> Option<Stamp> {
        let unit =
            |name: &str| Some(unit_of(name, STAMPS, &STAMP_UNITS)?.unwrap_or(StampUnit::BySize));
        let of_name = self.first(unit);
        let bare = || self.first(|it| SECONDS[..3].contains(&it).then_some(StampUnit::Seconds));
        let (column, unit) = of_name.or_else(bare)?;
        let name = self.0[column].as_str();
        let mut stems = SECONDS.iter().filter_map(|word| name.strip_suffix(word));
        let stem = stems.next().unwrap_or_default().to_owned();
        let rest = |stem: &str| {
            let units = RESTS.iter();
            let mut words = units.flat_map(|(words, ns)| words.split(' ').map(move |it| (it, *ns)));
            // `ns` alone may be north and south.
            words.find_map(|(word, ns)| {
                let column = self.find(&format!("{stem}{word}"))?;
                (!stem.is_empty() || word.len() > 2).then_some((column, ns))
            })
        };
        let stems = [stem, format!("{name}_"), String::new()];
        let found = stems.iter().find_map(|stem| rest(stem));
        let is_joined = matches!(unit, StampUnit::Seconds | StampUnit::BySize);
        let rest = found.filter(|(at, _)| is_joined && *at != column);
        Some(Stamp { column, unit, rest })
    }
}

#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Stamp {
    column: usize,
    unit: StampUnit,
    /// The column of the rest of whole seconds, and its unit, ns.
    rest: Option<(usize, i64)>,
}

impl Stamp {
    /// Stamps in the first column: in ns, or in the unit that their size implies.
    pub const fn first(is_by_size: bool) -> Self {
        let (column, rest) = (0, None);
        let unit = match is_by_size {
            true => StampUnit::BySize,
            false => StampUnit::Ns(1),
        };
        Self { column, unit, rest }
    }

    pub fn ns(&self, row: &StringRecord) -> Option<i64> {
        let ns = self.unit.ns(row.get(self.column)?)?;
        match self.rest {
            Some((column, unit)) if ns % SECOND_NS == 0 => with_rest(ns, row.get(column)?, unit),
            _ => Some(ns),
        }
    }
}

fn with_rest(whole_ns: i64, rest: &str, unit_ns: i64) -> Option<i64> {
    // Programs that know no integers write `500.0`.
    let rest = rest.strip_suffix(".0").unwrap_or(rest);
    let rest_ns = StampUnit::Ns(unit_ns).ns(rest).filter(|ns| *ns >= 0)?;
    let is_all = rest_ns >= SECOND_NS;
    Some(if is_all { rest_ns } else { whole_ns + rest_ns })
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum StampUnit {
    /// An integer number of so many ns.
    Ns(i64),
    Seconds,
    BySize,
}

impl StampUnit {
    fn ns(self, text: &str) -> Option<i64> {
        let ns = match self {
            Self::Ns(unit) => text.parse::<i64>().ok()?.checked_mul(unit),
            Self::Seconds => parse_seconds(text),
            Self::BySize => match text.parse::<i64>() {
                Ok(raw) => stamp_to_ns(raw),
                Err(_) => parse_seconds(text),
            },
        };
        ns.filter(|ns| (-MAX_NS..=MAX_NS).contains(ns))
    }
}

pub(crate) fn endings<T: Copy>(units: &[(&'static str, T)]) -> Vec<(&'static str, T)> {
    let of_unit = |(endings, unit): &(&'static str, T)| {
        let unit = *unit;
        endings.split(' ').map(move |ending| (ending, unit))
    };
    units.iter().flat_map(of_unit).collect()
}

/// Returns the unit of a column that has one of these names with the ending of a unit;
/// `Some(None)`: without one; `None`: it has another name.
pub(crate) fn unit_of<T: Copy>(
    name: &str,
    names: &str,
    units: &[(&'static str, T)],
) -> Option<Option<T>> {
    let is_one = |name: &str| names.split(' ').any(|it| it == name);
    let mut endings = endings(units).into_iter();
    match endings.find(|(ending, _)| name.strip_suffix(ending).is_some_and(is_one)) {
        Some((_, unit)) => Some(Some(unit)),
        None => is_one(name).then_some(None),
    }
}

fn plain(name: &str) -> String {
    let name = name.trim().trim_start_matches(['%', '#']);
    let name = name.strip_prefix("field.").unwrap_or(name).trim();
    let name = name.to_lowercase().replace([']', ')'], "");
    let name = name.replace([' ', '.', '/', '[', '('], "_");
    name.replace("__", "_").replace("^2", "2")
}
