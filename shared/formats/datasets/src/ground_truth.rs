//! Trajectory files: the ground truth of each dataset, and the common pose formats.

mod poses;
mod tables;

use std::{
    fmt::Display,
    path::{Path, PathBuf},
};

pub use poses::{write_kitti, write_tum, write_tum_pose};

use gyre_radar::trajectory::Trajectory;
use gyre_storage::quoted;

use crate::sample_log::roots;

/// Files of ground truth relative to the root of a dataset, in order of precedence.
const PLACES: [&str; 9] = [
    "ground_truth.tum",
    "gt/radar_odometry.csv",
    "radar_odometry.csv",
    "applanix/radar_poses.csv",
    "global_pose.csv",
    "ground_truth.txt",
    "gt.txt",
    "gt/gt.txt",
    "gt.tum",
];

const SEPARATORS: &str = "columns need spaces between them in TUM and KITTI, commas in the others, and numbers need decimal points";

/// The largest file: a month of poses at 10 Hz has 2.3 GB.
const MAX_BYTES: u64 = 4 << 30;

/// A trajectory that cannot be read: a sentence.
#[derive(Debug, thiserror::Error)]
#[error("{0}")]
pub struct TrajectoryError(String);

/// An error in a line (from 1); the caller adds the path of the file.
#[derive(Debug)]
struct LineError {
    line: usize,
    reason: String,
}

impl LineError {
    fn new(line: usize, reason: impl Into<String>) -> Self {
        let reason = reason.into();
        Self { line, reason }
    }

    fn of(self, path: &Path) -> TrajectoryError {
        let (path, Self { line, reason }) = (path.display(), self);
        TrajectoryError(format!("{path}, line {line}: {reason}"))
    }
}

type Parse = fn(&str) -> Result<Trajectory, LineError>;

/// Reads a trajectory of any known format, detected from its first line, and converts it to
/// REP-103. Sensors of TUM and KITTI files stay upright (z up or down): the poses are projected to
/// the plane. Of a folder, its ground truth is read.
pub fn read_trajectory(path: &Path) -> Result<Trajectory, TrajectoryError> {
    let missing = "it is a folder without a ground truth at a usual place: name the file";
    let file = match path.is_dir() {
        true => find_ground_truth(path).ok_or_else(|| unreadable(path, missing))?,
        false => path.to_owned(),
    };
    parse_trajectory(&read(&file)?, &file)
}

/// Reads the trajectory of a run (TUM). Its times may step back, as the clock of a radar does.
pub fn read_trajectory_of_run(path: &Path) -> Result<Trajectory, TrajectoryError> {
    poses::tum(&read(path)?).map_err(|error| error.of(path))
}

fn read(path: &Path) -> Result<String, TrajectoryError> {
    gyre_storage::read_text(path, MAX_BYTES).map_err(|error| unreadable(path, error))
}

fn unreadable(path: &Path, reason: impl Display) -> TrajectoryError {
    let path = path.display();
    TrajectoryError(format!("cannot read the trajectory {path}: {reason}"))
}

/// As [`read_trajectory`], from a text; `path` is the name in errors.
pub fn parse_trajectory(text: &str, path: &Path) -> Result<Trajectory, TrajectoryError> {
    let name = path.display();
    let unknown = |reason: String| {
        let formats =
            "Oxford radar_odometry.csv, Boreas radar_poses.csv, MulRan global_pose.csv, TUM, KITTI";
        TrajectoryError(format!(
            "{name} is not a trajectory of a known format ({formats}): {reason}"
        ))
    };
    let parse = detect(text).map_err(unknown)?;
    let parsed = parse(text).and_then(|trajectory| {
        check_times(text, &trajectory)?;
        check_places(text, &trajectory)?;
        Ok(trajectory)
    });
    parsed.map_err(|error| error.of(path))
}

/// Returns the ground truth file of a dataset, if there is one at a usual path. `root` may also be
/// the folder of images.
pub fn find_ground_truth(root: &Path) -> Option<PathBuf> {
    let mut places = roots(root).flat_map(|root| PLACES.map(|place| root.join(place)));
    places.find(|path| path.is_file())
}

/// Times must not run backwards.
fn check_times(text: &str, trajectory: &Trajectory) -> Result<(), LineError> {
    let stamps = trajectory.stamps();
    let back = stamps.windows(2).position(|pair| pair[1] < pair[0]);
    back.map_or(Ok(()), |index| {
        let back_s = (stamps[index] - stamps[index + 1]) as f64 * 1e-9;
        let reason = format!("time runs backwards by {back_s:.6} s");
        Err(LineError::new(line_of(text, trajectory, index + 1), reason))
    })
}

/// Returns the line of a pose.
fn line_of(text: &str, trajectory: &Trajectory, index: usize) -> usize {
    let header = lines(text).count().saturating_sub(trajectory.len());
    lines(text).nth(header + index).map_or(0, |(line, _)| line)
}

fn check_places(text: &str, trajectory: &Trajectory) -> Result<(), LineError> {
    let stamps = trajectory.stamps();
    let mut first = 0;
    for (index, pose) in trajectory.poses.iter().enumerate().take(stamps.len()) {
        if stamps[index] != stamps[first] {
            first = index;
        }
        let from = trajectory.poses[first].translation.vector;
        let apart_m = (pose.translation.vector - from).norm();
        if apart_m > MAX_APART_M {
            let reason = format!(
                "its place is {apart_m:.1} m from a place of the same time: the times are rounded, and need three decimals of a second or more"
            );
            return Err(LineError::new(line_of(text, trajectory, index), reason));
        }
    }
    Ok(())
}

fn detect(text: &str) -> Result<Parse, String> {
    let (_, first) = lines(text).next().ok_or("it is empty")?;
    let commas = first.split(',').count();
    let words = first.split_whitespace().count();
    let columns = commas.max(words);
    match (commas, words) {
        _ if first.contains(';') => Err(SEPARATORS.to_owned()),
        _ if first.contains("destination_timestamp") => Ok(tables::oxford),
        _ if tables::TIMES.iter().any(|name| first.contains(name)) => Ok(tables::boreas),
        (13, 1 | 13) => Ok(tables::mulran),
        (1, 8) => Ok(poses::tum),
        (1, 12 | 13) => Ok(poses::kitti),
        _ => Err(format!(
            "its first line has {columns} columns: {SEPARATORS}"
        )),
    }
}

/// Returns the non-empty lines, numbered from 1; `#` starts a comment.
fn lines(text: &str) -> impl Iterator<Item = (usize, &str)> {
    let lines = (1..).zip(text.lines().map(str::trim));
    lines.filter(|(_, line)| !line.is_empty() && !line.starts_with('#'))
}

/// The largest distance between places of one time, m: poses may be repeated.
const MAX_APART_M: f64 = 1.0;

/// The largest number: no product or sum of such overflows.
const LARGEST: f64 = 1e15;

fn numbers<'a, const N: usize>(
    line: usize,
    fields: impl Iterator<Item = &'a str>,
) -> Result<[f64; N], LineError> {
    let number = |field: &str| {
        let value = field.trim().parse::<f64>().ok();
        value.filter(|value| value.abs() <= LARGEST).ok_or_else(|| {
            let field = quoted(field);
            let reason = format!("{field} is not a number from -{LARGEST:e} to {LARGEST:e}");
            LineError::new(line, reason)
        })
    };
    let (mut values, mut count) = ([0.0; N], 0);
    for field in fields {
        let value = number(field)?;
        if let Some(into) = values.get_mut(count) {
            *into = value;
        }
        count += 1;
    }
    match count == N {
        true => Ok(values),
        false => Err(LineError::new(
            line,
            format!("{count} columns instead of {N}"),
        )),
    }
}

fn columns<const N: usize>(header: &str, names: [&str; N]) -> Result<[usize; N], LineError> {
    let mut found = [0; N];
    for (into, name) in found.iter_mut().zip(names) {
        let position = header.split(',').position(|h| h.trim() == name);
        let missing = || LineError::new(1, format!("the header has no column {name}"));
        *into = position.ok_or_else(missing)?;
    }
    Ok(found)
}

fn field(line: usize, row: &str, column: usize) -> Result<&str, LineError> {
    let field = row.split(',').nth(column).map(str::trim);
    field.ok_or_else(|| LineError::new(line, format!("column {} is missing", column + 1)))
}

fn number(line: usize, row: &str, column: usize) -> Result<f64, LineError> {
    numbers::<1>(line, std::iter::once(field(line, row, column)?)).map(|[v]| v)
}

/// Parses an integer stamp of any unit to ns since 1970.
fn stamp_field(line: usize, row: &str, column: usize) -> Result<i64, LineError> {
    let text = field(line, row, column)?;
    let stamp = text.parse().ok().and_then(crate::dataset::stamp::to_ns);
    stamp.ok_or_else(|| {
        let text = quoted(text);
        let reason = format!("stamp {text} is not an integer time of the years 2015 to 2040");
        LineError::new(line, reason)
    })
}

/// Collects what rows have at their times.
fn stamped<'a, T>(
    rows: impl Iterator<Item = (usize, &'a str)>,
    parse: impl Fn(usize, &str) -> Result<(i64, T), LineError>,
) -> Result<(Vec<i64>, Vec<T>), LineError> {
    let (mut stamps, mut values) = (Vec::<i64>::new(), Vec::new());
    for (line, row) in rows {
        let (stamp, value) = parse(line, row)?;
        stamps.push(stamp);
        values.push(value);
    }
    Ok((stamps, values))
}
