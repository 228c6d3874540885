//! `gyre-lab gnss`: cuts holes out of the fixes of a run, and measures how SLAM bridges them.

use std::{ops::Range, path::PathBuf, process::ExitCode};

use clap::Args;
use gyre_configuration::{Configuration, gnss_log};
use gyre_estimation::{Position, align};
use gyre_geometry::Pose;
use gyre_radar::median;
use gyre_samples::GnssFix;
use gyre_slam::{Fixes, Keyframe, Query, RecordReader, TrajectoryEstimator, TrajectoryOptions};
use gyre_terminal::Failure;
use nalgebra::{Point2, Vector2};
use serde_json::{Value, json};

use crate::report::{Record, Table, make_folder, publish, record};

/// Shares of less than this path say nothing, m: the vehicle stood.
const SHORTEST_M: f64 = 10.0;

#[derive(Debug, Args)]
pub struct GnssArguments {
    /// The results of a run with slam.kind=graph: a folder with config.toml and journal.
    pub run: PathBuf,
    /// Override a key of its configuration, as in gnss.kind=auto; may be repeated.
    #[arg(long = "set", value_name = "KEY=VALUE")]
    pub set: Vec<String>,
    /// Durations of the holes, s.
    #[arg(long, value_delimiter = ',', default_value = "5,10,15,20,25,30")]
    pub seconds: Vec<f64>,
    /// Holes of each duration, evenly spaced over the drive. One is cut at a time.
    #[arg(long, default_value = "10")]
    pub places: usize,
    /// Leave out the loops.
    #[arg(long)]
    pub without_loops: bool,
    /// The folder of gnss.md and gnss.json.
    #[arg(long, default_value = "out/gnss")]
    pub out: PathBuf,
}

/// The keyframes, loops and fixes of a run.
struct Drive {
    keyframes: Vec<Keyframe>,
    queries: Vec<Query>,
    fixes: Vec<GnssFix>,
    configuration: Configuration,
}

/// An estimate of the poses of keyframes in the plane of the fixes.
struct Placed {
    east_north_from_map: Pose,
    poses: Vec<Pose>,
}

/// Cuts holes, corrects the trajectory, and measures.
///
/// # Errors
/// Results that cannot be read, a run without keyframes, or fixes that cannot be used.
pub fn gnss(arguments: &GnssArguments) -> Result<ExitCode, Failure> {
    let drive = Drive::read(arguments)?;
    make_folder(&arguments.out)?;
    let (whole, positions) = drive.with_fixes(&drive.fixes)?;
    let without = drive.estimate(&[])?.poses().to_vec();
    let mut rows = Vec::new();
    for seconds in &arguments.seconds {
        let holes = drive.holes(*seconds, arguments.places);
        let holes: Result<Vec<_>, Failure> = holes
            .into_iter()
            .map(|hole| drive.hole(hole, &positions, &whole, &without))
            .collect();
        rows.push((
            format!("{seconds} s"),
            holes?.into_iter().flatten().collect(),
        ));
    }
    let all: Vec<Hole> = rows.iter().flat_map(|(_, holes)| holes).copied().collect();
    rows.push(("all".to_owned(), all));
    let tables = [
        fit_table(&whole, &without, &positions),
        holes_table(rows.iter().map(|(name, holes)| row(name, holes)).collect()),
    ];
    publish("gnss", &tables, &arguments.out)?;
    Ok(ExitCode::SUCCESS)
}

impl Drive {
    fn read(arguments: &GnssArguments) -> Result<Self, Failure> {
        let run = &arguments.run;
        let configuration = Configuration::read(&run.join("config.toml"), &arguments.set)?;
        let log = gnss_log(&configuration)?;
        let log = log.ok_or("the run has no fixes: add --set gnss.kind=auto")?;
        let mut keyframes = RecordReader::<Keyframe>::open(run)?;
        let mut queries = RecordReader::<Query>::open(run)?;
        let count = if arguments.without_loops {
            0
        } else {
            queries.len()
        };
        Ok(Self {
            keyframes: (0..keyframes.len())
                .map(|index| keyframes.read_without_points(index))
                .collect::<Result<_, _>>()?,
            queries: (0..count)
                .map(|index| queries.read(index))
                .collect::<Result<_, _>>()?,
            fixes: log.on_radar(&configuration.gnss),
            configuration,
        })
    }

    fn estimate(&self, fixes: &[GnssFix]) -> Result<TrajectoryEstimator, Failure> {
        let fixes = Fixes::new(fixes.to_vec(), &self.configuration.gnss);
        let mut estimator =
            TrajectoryEstimator::new(TrajectoryOptions::default()).with_fixes(fixes);
        for keyframe in &self.keyframes {
            estimator.push(keyframe)?;
        }
        for query in &self.queries {
            estimator.close(query)?;
        }
        estimator.solve()?;
        Ok(estimator)
    }

    /// Estimates the poses with these fixes; with the fixes that the keyframes have.
    fn with_fixes(&self, fixes: &[GnssFix]) -> Result<(Placed, Vec<(i64, Position)>), Failure> {
        let mut estimator = self.estimate(fixes)?;
        if let Some(refusal) = estimator.fixes().refusal() {
            return Err(refusal.to_string().into());
        }
        let frame = estimator.east_north_from_map()?;
        let placed = Placed {
            east_north_from_map: frame.ok_or("the fixes do not tell the heading")?.motion,
            poses: estimator.poses().to_vec(),
        };
        Ok((placed, estimator.fixes().positions().to_vec()))
    }

    /// Returns holes of a duration, evenly spaced over the drive, ns.
    fn holes(&self, seconds: f64, places: usize) -> Vec<Range<i64>> {
        let [Some(first), Some(last)] = [self.keyframes.first(), self.keyframes.last()] else {
            return Vec::new();
        };
        let ns = (seconds * 1e9) as i64;
        let room = last.stamp_ns - first.stamp_ns - ns;
        let start = |k: usize| first.stamp_ns + room * (k as i64 + 1) / (places as i64 + 1);
        (0..places).map(|k| start(k)..start(k) + ns).collect()
    }

    /// Measures a hole; `None` where the vehicle hardly moved in it, or had no fixes.
    fn hole(
        &self,
        hole: Range<i64>,
        positions: &[(i64, Position)],
        whole: &Placed,
        without: &[Pose],
    ) -> Result<Option<Hole>, Failure> {
        let inside = |stamp_ns: &i64| hole.contains(stamp_ns);
        let cut: Vec<&(i64, Position)> = positions.iter().filter(|it| inside(&it.0)).collect();
        let Some((_, last)) = cut.last() else {
            return Ok(None);
        };
        let middle_ns = hole.start + (hole.end - hole.start) / 2;
        let middle = cut.iter().min_by_key(|it| it.0.abs_diff(middle_ns));
        let middle = middle.map_or(*last, |it| it.1);
        let path_m =
            self.keyframes[last.keyframe].path_m - self.keyframes[cut[0].1.keyframe].path_m;
        let before = positions.iter().rev().find(|it| it.0 < hole.start);
        let Some((_, before)) = before.filter(|_| path_m >= SHORTEST_M) else {
            return Ok(None);
        };
        let fixes = self.fixes.iter().filter(|fix| !inside(&fix.stamp_ns));
        let fixes: Vec<GnssFix> = fixes.copied().collect();
        let (bridged, _) = self.with_fixes(&fixes)?;
        let outside = positions.iter().filter(|it| !inside(&it.0));
        let frame = align(without, outside.map(|it| &it.1));
        let aligned = Placed {
            east_north_from_map: frame.ok_or("the fixes do not tell the heading")?,
            poses: without.to_vec(),
        };
        let of = |placed: &Placed| Errors {
            middle_m: placed.error(&middle).norm(),
            end_m: placed.error(last).norm(),
            since_start_m: (placed.error(last) - placed.error(before)).norm(),
        };
        Ok(Some(Hole {
            path_m,
            bridged: of(&bridged),
            without: of(&aligned),
            uncut: of(whole),
        }))
    }
}

impl Placed {
    /// The estimated less the measured position, m.
    fn error(&self, position: &Position) -> Vector2<f64> {
        let pose = self.east_north_from_map * self.poses[position.keyframe];
        (pose * Point2::from(position.lever_m)).coords - position.position_m
    }
}

/// The errors in a hole against the fixes that were cut out, m.
#[derive(Clone, Copy)]
struct Errors {
    middle_m: f64,
    end_m: f64,
    /// The change of the error from the last fix before the hole to the end.
    since_start_m: f64,
}

#[derive(Clone, Copy)]
struct Hole {
    path_m: f64,
    bridged: Errors,
    without: Errors,
    /// Of the estimate with all fixes: how far the fixes themselves lie from it.
    uncut: Errors,
}

fn row(name: &str, holes: &[Hole]) -> Record {
    let middle = |of: &dyn Fn(&Hole) -> f64| median(holes.iter().map(of));
    let percent = |of: fn(&Hole) -> f64| middle(&|hole| 100.0 * of(hole) / hole.path_m);
    let most = holes
        .iter()
        .map(|hole| 100.0 * hole.bridged.since_start_m / hole.path_m);
    record(json!({
        "holes": name, "count": holes.len(),
        "path_m": middle(&|hole| hole.path_m),
        "middle_m": middle(&|hole| hole.bridged.middle_m),
        "end_m": middle(&|hole| hole.bridged.end_m),
        "end_percent": percent(|hole| hole.bridged.end_m),
        "grown_m": middle(&|hole| hole.bridged.since_start_m),
        "grown_percent": percent(|hole| hole.bridged.since_start_m),
        "most_percent": most.reduce(f64::max),
        "without_middle_m": middle(&|hole| hole.without.middle_m),
        "without_end_m": middle(&|hole| hole.without.end_m),
        "without_grown_percent": percent(|hole| hole.without.since_start_m),
        "uncut_end_m": middle(&|hole| hole.uncut.end_m),
        "uncut_grown_percent": percent(|hole| hole.uncut.since_start_m),
    }))
}

fn holes_table(rows: Vec<Record>) -> Table {
    Table {
        title: "Holes".to_owned(),
        columns: vec![
            ("holes", "hole", 0),
            ("count", "count", 0),
            ("path_m", "path m", 0),
            ("middle_m", "middle m", 2),
            ("end_m", "end m", 2),
            ("end_percent", "end %", 2),
            ("grown_m", "since start m", 2),
            ("grown_percent", "since start %", 2),
            ("most_percent", "most %", 2),
            ("without_middle_m", "without GNSS: middle m", 2),
            ("without_end_m", "end m", 2),
            ("without_grown_percent", "since start %", 2),
            ("uncut_end_m", "nothing cut: end m", 2),
            ("uncut_grown_percent", "since start %", 2),
        ],
        rows,
        legend: format!(
            "Medians against the fixes that were cut out, over the holes in which the vehicle drove {SHORTEST_M} m or more. \
             `since start` is the error at the end less that at the last fix before the hole, as vectors; `%` of the path in the hole. \
             Without GNSS: SLAM by the radar alone, laid onto the fixes outside the hole. Nothing cut: the same fixes, with the estimate that uses them."
        ),
        ..Table::default()
    }
}

/// How far all fixes lie from the estimates, m.
fn fit_table(whole: &Placed, without: &[Pose], positions: &[(i64, Position)]) -> Table {
    let aligned = align(without, positions.iter().map(|it| &it.1)).map(|frame| Placed {
        east_north_from_map: frame,
        poses: without.to_vec(),
    });
    let row = |name: &str, placed: &Placed| {
        let errors = positions.iter().map(|it| placed.error(&it.1).norm());
        let errors: Vec<f64> = errors.collect();
        let squares: f64 = errors.iter().map(|error| error * error).sum();
        let value: Value = json!({
            "estimate": name, "fixes": errors.len(),
            "rms_m": (squares / errors.len() as f64).sqrt(),
            "median_m": median(errors.iter().copied()),
            "most_m": errors.iter().copied().reduce(f64::max),
        });
        record(value)
    };
    let mut rows = vec![row("with GNSS", whole)];
    rows.extend(aligned.map(|placed| row("without, laid onto the fixes", &placed)));
    Table {
        title: "All fixes".to_owned(),
        columns: vec![
            ("estimate", "SLAM", 0),
            ("fixes", "fixes", 0),
            ("rms_m", "rms m", 2),
            ("median_m", "median m", 2),
            ("most_m", "most m", 2),
        ],
        rows,
        ..Table::default()
    }
}
