//! The figures of a run or a trajectory in one list. The table of the terminal, its five lines and
//! the page of `gyre report` take names, units and decimals from the list.
//!
//! A place in `summary.json` identifies a figure, so that old and new runs look alike.

use std::sync::LazyLock;

use gyre_contract::Witness;
use serde_json::Value;

#[derive(Clone, Copy, Debug)]
pub struct Figure {
    pub name: &'static str,
    /// The place in `summary.json`, as in `/motions/weak`.
    place: &'static str,
    decimals: usize,
    factor: f64,
    kind: Kind,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Kind {
    Plain,
    /// An error: the smallest is the best.
    Error,
    Unusual,
}

pub type Group = (&'static str, Vec<Figure>);

const fn count(name: &'static str, place: &'static str) -> Figure {
    number(name, place, 0, 1.0)
}

const fn number(name: &'static str, place: &'static str, decimals: usize, factor: f64) -> Figure {
    Figure {
        name,
        place,
        decimals,
        factor,
        kind: Kind::Plain,
    }
}

const fn unusual(name: &'static str, place: &'static str) -> Figure {
    Figure {
        kind: Kind::Unusual,
        ..count(name, place)
    }
}

const fn error(name: &'static str, place: &'static str, decimals: usize) -> Figure {
    Figure {
        kind: Kind::Error,
        ..number(name, place, decimals, 1.0)
    }
}

pub const ACCURACY: &str = "Accuracy";

#[rustfmt::skip]
pub static GROUPS: LazyLock<[Group; 5]> = LazyLock::new(|| [
    ("Drive", vec![
        count("problem", "/problem"),
        number("path, m", "/path_m", 1, 1.0),
        number("duration, s", "/duration_s", 1, 1.0),
        count("poses", "/processed"),
        count("compared with the ground truth", "/evaluation/coverage/matched"),
    ]),
    (ACCURACY, vec![
        error("ATE, rmse, m", "/evaluation/ate/rmse_m", 3),
        error("ATE, largest, m", "/evaluation/ate/max_m", 3),
        error("drift (KITTI), %", "/evaluation/kitti/translation_percent", 3),
        error("drift (KITTI), deg/100 m", "/evaluation/kitti/rotation_deg_per_100m", 3),
        error("seg, %", "/evaluation/seg/percent", 3),
        error("end point, m", "/evaluation/end/position_m", 2),
        error("end point, deg", "/evaluation/end/heading_deg", 2),
    ]),
    ("Latency", vec![
        number("latency, median, ms", "/latency/sensor_to_pose/p50_us", 1, 1e-3),
        number("latency, 99 %, ms", "/latency/sensor_to_pose/p99_us", 1, 1e-3),
        number("time between scans, ms", "/period_s", 0, 1e3),
        number("scans/s", "/scans_per_s", 1, 1.0),
        number("computed in, s", "/wall_s", 1, 1.0),
    ]),
    ("Counts", [&[
        count("scans published", "/published"),
        unusual("scans dropped", "/dropped"),
        unusual("scans unreadable", "/unreadable"),
        unusual("scans missing in the recording", "/missing"),
        unusual("breaks, where the path starts again", "/breaks"),
        unusual("commands that came after the last scan", "/commands_without_scan"),
        unusual("azimuths lost, which are put back", "/lost/azimuths"),
        unusual("of them at unknown places", "/lost/unplaced"),
        count("motions refined", "/motions/refined"),
        count("of them by a second hypothesis", "/motions/second_hypothesis"),
        unusual("motions weak", "/motions/weak"),
        unusual("motions predicted, since nothing matched", "/motions/predicted"),
        count("motions of a standing vehicle", "/motions/stationary"),
        count("motions along walls without structure", "/motions/along_walls"),
    ][..], &of_sensors(), &[
        unusual("restarts of processes", "/restarts"),
        count("recovered after, ms", "/recovery_ms"),
        count("keyframes", "/slam/keyframes"),
        count("loops", "/slam/loops_used"),
        count("loops rejected", "/slam/loops_rejected"),
        number("ATE after loops, m", "/slam/ate_m", 3, 1.0),
        number("odometry against the loops, m rms", "/slam/odometry/translation_rmse_m", 2, 1.0),
        number("odometry against the loops, deg rms", "/slam/odometry/rotation_rmse_deg", 2, 1.0),
        number("ground truth against the loops, m rms", "/slam/ground_truth/translation_rmse_m", 2, 1.0),
        number("ground truth against the loops, deg rms", "/slam/ground_truth/rotation_rmse_deg", 2, 1.0),
        count("fixes of GNSS used", "/gnss/used"),
        count("fixes of GNSS refused", "/gnss/refused"),
        count("fixes of GNSS not used, since", "/gnss/refusal"),
        count("entries of the log of GNSS", "/gnss/faults"),
        number("fixes from the trajectory, m rms", "/gnss/residual_rms_m", 2, 1.0),
        number("begins at latitude, deg", "/gnss/origin/latitude_deg", 6, 1.0),
        number("begins at longitude, deg", "/gnss/origin/longitude_deg", 6, 1.0),
        number("begins with heading, deg", "/gnss/origin/heading_deg", 2, 1.0),
    ][..]].concat()),
    ("Versions", vec![
        count("ending", "/ending"),
        count("data", "/data"),
        count("mode", "/mode"),
        number("rate", "/rate", 1, 1.0),
        count("network of the mask", "/mask/model"),
        count("computed by", "/mask/backend"),
        count("SHA-256 of the network", "/mask/sha256"),
        count("version of Gyre", "/version"),
        count("processor", "/machine/processor"),
    ]),
]);

fn of_sensors() -> Vec<Figure> {
    let rows = Witness::ALL.iter().flat_map(|kind| kind.row().figures);
    let figures = rows.map(|(name, place, decimals)| match decimals {
        Some(decimals) => number(name, place, *decimals, 1.0),
        None => unusual(name, place),
    });
    figures.collect()
}

impl Figure {
    pub fn text(&self, summary: &Value) -> Option<String> {
        self.text_of(summary.pointer(self.place)?)
    }

    fn text_of(&self, value: &Value) -> Option<String> {
        let text = match value {
            Value::Null => return None,
            Value::String(text) => text.clone(),
            Value::Array(values) => {
                let texts = values.iter().filter_map(|it| self.text_of(it));
                texts.collect::<Vec<_>>().join(", ")
            }
            Value::Object(values) => {
                let counted = values.iter().filter(|(_, it)| it.as_f64() != Some(0.0));
                let texts = counted.filter_map(|(name, it)| {
                    let text = self.text_of(it)?;
                    Some(format!("{} {text}", name.replace('_', " ")))
                });
                texts.collect::<Vec<_>>().join(", ")
            }
            Value::Bool(is_so) => is_so.to_string(),
            Value::Number(_) => {
                let (number, decimals) = (value.as_f64()? * self.factor, self.decimals);
                let number = match self.kind {
                    Kind::Error => number.abs(),
                    _ => number,
                };
                format!("{number:.decimals$}")
            }
        };
        Some(text).filter(|text| !text.is_empty())
    }

    /// Returns an error, to be compared with others; `None` of another figure.
    pub fn error(&self, summary: &Value) -> Option<f64> {
        let value = summary.pointer(self.place)?.as_f64()?;
        (self.kind == Kind::Error).then_some(value.abs())
    }
}

/// Returns the counts of the unusual events of a run, with their names, or `nothing`.
pub fn all_unusual(summary: &Value) -> String {
    let figures = GROUPS.iter().flat_map(|(_, figures)| figures);
    let unusual = figures.filter(|it| it.kind == Kind::Unusual);
    let counted = unusual.filter_map(|figure| {
        let count = match summary.pointer(figure.place)? {
            Value::Object(counts) => counts.values().filter_map(Value::as_u64).sum(),
            count => count.as_u64()?,
        };
        (count > 0).then(|| format!("{count} {}", figure.name))
    });
    match counted.collect::<Vec<_>>() {
        none if none.is_empty() => "nothing".to_owned(),
        counted => counted.join(", "),
    }
}
