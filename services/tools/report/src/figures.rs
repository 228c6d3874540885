//! The figures of runs and trajectories, as rows of a table.

use gyre_evaluation::Evaluation;

use crate::subject::{Run, Subject};

/// A row: a name, and a value for each subject.
pub struct Row {
    /// The name, with the unit.
    pub name: &'static str,
    /// The values as text; `None`: it has none.
    pub values: Vec<Option<String>>,
    /// Of errors, the place of the smallest, where there are several.
    pub best: Option<usize>,
}

/// Rows under a title.
pub struct Group {
    /// The title.
    pub title: &'static str,
    /// The rows that have a value.
    pub rows: Vec<Row>,
}

type Text = fn(&Subject) -> Option<String>;
type Error = fn(&Evaluation) -> Option<f64>;

const DRIVE: [(&str, Text); 5] = [
    ("problem", |it| {
        Some(it.run.as_ref()?.word("/problem")?.to_owned())
    }),
    ("path, m", |it| {
        Some(format!("{:.1}", it.trajectory.path_length_m()))
    }),
    ("duration, s", |it| Some(format!("{:.1}", it.duration_s()?))),
    ("poses", |it| Some(it.trajectory.poses.len().to_string())),
    ("compared with the ground truth", |it| {
        Some(it.evaluation.as_ref()?.matched.len().to_string())
    }),
];

const ERRORS: [(&str, usize, Error); 7] = [
    ("ATE, rmse, m", 3, |it| Some(it.ate.rmse_m)),
    ("ATE, largest, m", 3, |it| Some(it.ate.max_m)),
    ("drift (KITTI), %", 3, |it| {
        Some(it.kitti.as_ref()?.translation_percent)
    }),
    ("drift (KITTI), deg/100 m", 3, |it| {
        Some(it.kitti.as_ref()?.rotation_deg_per_100m)
    }),
    ("seg, %", 3, |it| Some(it.seg.as_ref()?.percent)),
    ("end point, m", 2, |it| Some(it.end.as_ref()?.position_m)),
    ("end point, deg", 2, |it| {
        Some(it.end.as_ref()?.heading_deg.abs())
    }),
];

/// Figures of the summary of a run: name, place, decimals, factor.
type Figure = (&'static str, &'static str, usize, f64);

const TIMES: [Figure; 5] = [
    (
        "latency, median, ms",
        "/latency/sensor_to_pose/p50_us",
        1,
        1e-3,
    ),
    (
        "latency, 99 %, ms",
        "/latency/sensor_to_pose/p99_us",
        1,
        1e-3,
    ),
    ("time between scans, ms", "/period_s", 0, 1e3),
    ("scans/s", "/scans_per_s", 1, 1.0),
    ("computed in, s", "/wall_s", 1, 1.0),
];

const COUNTS: [Figure; 12] = [
    ("scans dropped", "/dropped", 0, 1.0),
    ("scans unreadable", "/unreadable", 0, 1.0),
    ("scans missing in the recording", "/missing", 0, 1.0),
    ("breaks", "/breaks", 0, 1.0),
    ("azimuths lost", "/lost/azimuths", 0, 1.0),
    ("motions refined", "/motions/refined", 0, 1.0),
    ("motions weak", "/motions/weak", 0, 1.0),
    ("motions predicted", "/motions/predicted", 0, 1.0),
    (
        "motions of a standing vehicle",
        "/motions/stationary",
        0,
        1.0,
    ),
    ("loops", "/slam/loops_used", 0, 1.0),
    ("loops rejected", "/slam/loops_rejected", 0, 1.0),
    ("ATE after loops, m", "/slam/ate_m", 3, 1.0),
];

const WORDS: [(&str, &str); 9] = [
    ("ending", "/ending"),
    ("data", "/data"),
    ("mode", "/mode"),
    ("rate", "/rate"),
    ("network of the mask", "/mask/model"),
    ("computed by", "/mask/backend"),
    ("SHA-256 of the network", "/mask/sha256"),
    ("version of Gyre", "/version"),
    ("processor", "/machine/processor"),
];

/// Returns all figures that one of the subjects has.
pub fn groups(subjects: &[Subject]) -> Vec<Group> {
    let texts = DRIVE.map(|(name, of)| row(name, subjects.iter().map(of).collect()));
    let errors = ERRORS.map(|(name, decimals, of)| errors(name, decimals, of, subjects));
    let of_summary = |(name, place, decimals, factor): Figure| {
        let number = |run: &Run| Some(format!("{:.decimals$}", run.number(place)? * factor));
        of_runs(name, subjects, number)
    };
    let words = WORDS
        .map(|(name, place)| of_runs(name, subjects, |run| run.word(place).map(str::to_owned)));
    let groups = [
        ("Drive", Vec::from(texts)),
        ("Accuracy", Vec::from(errors)),
        ("Latency", Vec::from(TIMES.map(of_summary))),
        ("Counts", Vec::from(COUNTS.map(of_summary))),
        ("Versions", Vec::from(words)),
    ];
    let has_value = |row: &Row| row.values.iter().any(Option::is_some);
    let groups = groups.map(|(title, rows)| Group {
        title,
        rows: rows.into_iter().filter(has_value).collect(),
    });
    let groups = groups.into_iter();
    groups.filter(|group| !group.rows.is_empty()).collect()
}

fn row(name: &'static str, values: Vec<Option<String>>) -> Row {
    Row {
        name,
        values,
        best: None,
    }
}

fn of_runs(name: &'static str, subjects: &[Subject], of: impl Fn(&Run) -> Option<String>) -> Row {
    let values = subjects.iter().map(|it| it.run.as_ref().and_then(&of));
    row(name, values.collect())
}

/// Returns the row of an error, of which the smallest is the best.
fn errors(name: &'static str, decimals: usize, of: Error, subjects: &[Subject]) -> Row {
    let values = subjects
        .iter()
        .map(|it| it.evaluation.as_ref().and_then(of));
    let values: Vec<Option<f64>> = values.collect();
    let known = values.iter().enumerate();
    let known = known.filter_map(|(place, value)| Some((place, (*value)?)));
    let best = known.min_by(|(_, one), (_, other)| one.total_cmp(other));
    let text = |value: &Option<f64>| value.map(|value| format!("{value:.decimals$}"));
    Row {
        best: best.map(|(place, _)| place).filter(|_| subjects.len() > 1),
        ..row(name, values.iter().map(text).collect())
    }
}
