//! `gyre-lab gnss`: cuts holes out of the fixes of a run, and measures how SLAM bridges them.

mod lever;

use std::{ops::Range, path::PathBuf, process::ExitCode};

use clap::Args;
use gyre_configuration::{Configuration, gnss_log, terminal::Failure};
use gyre_geometry::{Pose, samples::{GnssConfig, GnssFix}};
use gyre_radar::median;
use gyre_slam::{estimation::{Position, align}, EstimatorKind, Fixes, Keyframe, Query, RecordReader, TrajectoryEstimator};
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
    /// Fit the lever arm of the antenna to the fixes outside each hole.
    #[arg(long)]
    pub fit_lever: bool,
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
    config: GnssConfig,
    /// The poses of SLAM by the radar alone.
    without: Vec<Pose>,
}

/// The fixes that keyframes have, with their times.
type Positions = Vec<(i64, Position)>;

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
    let positions = drive.positions(drive.config.lever_m)?;
    let fitted = lever::fit_with_sigma(&drive.without, &places(&positions));
    let whole = match arguments.fit_lever {
        true => drive.with_lever(|_| true)?,
        false => drive.config.clone(),
    };
    let positions = drive.positions(whole.lever_m)?;
    let whole = drive.placed(&drive.fixes, &whole)?;
    let mut rows = Vec::new();
    for seconds in &arguments.seconds {
        let mut holes = Vec::new();
        for hole in drive.holes(*seconds, arguments.places) {
            holes.extend(drive.hole(hole, &whole, arguments.fit_lever)?);
        }
        rows.push((format!("{seconds} s"), holes));
    }
    let all: Vec<Hole> = rows.iter().flat_map(|(_, holes)| holes).copied().collect();
    rows.push(("all".to_owned(), all));
    let tables = [
        lever_table(&drive.config, fitted.as_ref()),
        fit_table(&whole, &drive.without, &positions),
        holes_table(rows.iter().map(|(name, holes)| row(name, holes)).collect()),
    ];
    publish("gnss", &tables, &arguments.out)?;
    Ok(ExitCode::SUCCESS)
}

fn places(positions: &[(i64, Position)]) -> Vec<Position> {
    positions.iter().map(|it| it.1).collect()
}

impl Drive {
    fn read(arguments: &GnssArguments) -> Result<Self, Failure> {
        let run = &arguments.run;
        let configuration = Configuration::read(&run.join("config.toml"), &arguments.set)?;
        let log = gnss_log(&configuration, run)?;
        let log = log.ok_or("the run has no fixes: add --set gnss.kind=auto")?;
        let mut keyframes = RecordReader::<Keyframe>::open(run)?;
        let mut queries = RecordReader::<Query>::open(run)?;
        let loops = match arguments.without_loops {
            true => 0,
            false => queries.len(),
        };
        let mut drive = Self {
            keyframes: (0..keyframes.len())
                .map(|index| Keyframe::without_points(&mut keyframes, index))
                .collect::<Result<_, _>>()?,
            queries: (0..loops)
                .map(|index| queries.read(index))
                .collect::<Result<_, _>>()?,
            fixes: log.on_radar(&configuration.gnss),
            config: configuration.gnss,
            without: Vec::new(),
        };
        let mut radar_alone = drive.estimator(&[], &drive.config)?;
        radar_alone.solve()?;
        drive.without = radar_alone.poses().to_vec();
        Ok(drive)
    }

    fn estimator(
        &self,
        fixes: &[GnssFix],
        config: &GnssConfig,
    ) -> Result<TrajectoryEstimator, Failure> {
        let fixes = Fixes::new(fixes.to_vec(), config);
        let mut estimator = TrajectoryEstimator::new(EstimatorKind::Graph).with_fixes(fixes);
        for keyframe in &self.keyframes {
            estimator.push(keyframe)?;
        }
        for query in &self.queries {
            estimator.close(query)?;
        }
        Ok(estimator)
    }

    /// Returns all fixes that keyframes have, with this lever arm.
    fn positions(&self, lever_m: [f64; 2]) -> Result<Positions, Failure> {
        let config = GnssConfig {
            lever_m,
            ..self.config.clone()
        };
        let estimator = self.estimator(&self.fixes, &config)?;
        Ok(estimator.fixes().positions().to_vec())
    }

    /// Returns the configuration with the lever arm that fits the fixes of some times best.
    fn with_lever(&self, some: impl Fn(i64) -> bool) -> Result<GnssConfig, Failure> {
        let mut positions = self.positions(self.config.lever_m)?;
        positions.retain(|it| some(it.0));
        let lever = lever::fit(&self.without, &places(&positions));
        let lever = lever.ok_or("the drive does not tell the lever arm")?;
        let [forward, left] = self.config.lever_m;
        Ok(GnssConfig {
            lever_m: [forward + lever.x, left + lever.y],
            ..self.config.clone()
        })
    }

    /// Estimates the poses with these fixes.
    fn placed(&self, fixes: &[GnssFix], config: &GnssConfig) -> Result<Placed, Failure> {
        let mut estimator = self.estimator(fixes, config)?;
        estimator.solve()?;
        if let Some(refusal) = estimator.fixes().refusal() {
            return Err(refusal.to_string().into());
        }
        let frame = estimator.east_north_from_map()?;
        Ok(Placed {
            east_north_from_map: frame.ok_or("the fixes do not tell the heading")?.motion,
            poses: estimator.poses().to_vec(),
        })
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
        whole: &Placed,
        fit_lever: bool,
    ) -> Result<Option<Hole>, Failure> {
        let config = match fit_lever {
            true => self.with_lever(|stamp_ns| !hole.contains(&stamp_ns))?,
            false => self.config.clone(),
        };
        let positions = self.positions(config.lever_m)?;
        let (cut, kept): (Positions, Positions) =
            positions.into_iter().partition(|it| hole.contains(&it.0));
        let before = kept.iter().rev().find(|it| it.0 < hole.start);
        let after = kept.iter().find(|it| it.0 >= hole.end);
        let (Some(before), Some(after), [first, .., last]) = (before, after, cut.as_slice()) else {
            return Ok(None);
        };
        let path_m =
            self.keyframes[last.1.keyframe].path_m - self.keyframes[first.1.keyframe].path_m;
        let middle_ns = hole.start + (hole.end - hole.start) / 2;
        let middle = cut.iter().min_by_key(|it| it.0.abs_diff(middle_ns));
        let Some(middle) = middle.filter(|_| path_m >= SHORTEST_M) else {
            return Ok(None);
        };
        let outside = self
            .fixes
            .iter()
            .filter(|fix| !hole.contains(&fix.stamp_ns));
        let outside: Vec<GnssFix> = outside.copied().collect();
        let bridged = self.placed(&outside, &config)?;
        let frame = align(&self.without, kept.iter().map(|it| &it.1));
        let aligned = Placed {
            east_north_from_map: frame.ok_or("the fixes do not tell the heading")?,
            poses: self.without.clone(),
        };
        let share = (middle.0 - before.0) as f64 / (after.0 - before.0) as f64;
        let of = |placed: &Placed| {
            let error = |it: &(i64, Position)| placed.error(&it.1);
            let tied = error(before).lerp(&error(after), share);
            Errors {
                middle_m: error(middle).norm(),
                end_m: error(last).norm(),
                since_start_m: (error(last) - error(before)).norm(),
                tied_m: (error(middle) - tied).norm(),
            }
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
    /// The error in the middle less that of the fixes before and after the hole, by time.
    tied_m: f64,
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
        "tied_m": middle(&|hole| hole.bridged.tied_m),
        "tied_percent": percent(|hole| hole.bridged.tied_m),
        "without_tied_percent": percent(|hole| hole.without.tied_m),
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
            ("tied_m", "middle, tied m", 2),
            ("tied_percent", "tied %", 2),
            ("without_middle_m", "without GNSS: middle m", 2),
            ("without_end_m", "end m", 2),
            ("without_grown_percent", "since start %", 2),
            ("without_tied_percent", "tied %", 2),
            ("uncut_end_m", "nothing cut: end m", 2),
            ("uncut_grown_percent", "since start %", 2),
        ],
        rows,
        legend: format!(
            "Medians against the fixes that were cut out, over the holes in which the vehicle drove {SHORTEST_M} m or more. \
             `since start` is the error at the end less that at the last fix before the hole, as vectors; `tied` the one in the middle less those of the last fix before and the first after, by time; `%` of the path in the hole. \
             Without GNSS: SLAM by the radar alone, laid onto the fixes outside the hole. Nothing cut: the same fixes, with the estimate that uses them."
        ),
        ..Table::default()
    }
}

/// The distances of all fixes from the estimates, m.
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

/// The lever arm that the fixes of the whole drive tell.
fn lever_table(config: &GnssConfig, fitted: Option<&lever::Lever>) -> Table {
    let [forward, left] = config.lever_m;
    let row = fitted.map(|it| {
        record(json!({
            "forward_m": forward + it.forward_left_m.x, "forward_sigma_m": it.sigma_m.x,
            "left_m": left + it.forward_left_m.y, "left_sigma_m": it.sigma_m.y,
        }))
    });
    Table {
        title: "Lever arm".to_owned(),
        columns: vec![
            ("forward_m", "forward m", 2),
            ("forward_sigma_m", "+-", 2),
            ("left_m", "left m", 2),
            ("left_sigma_m", "+-", 2),
        ],
        rows: row.into_iter().collect(),
        legend: "The antenna in the frame of the radar that fits all fixes best, with SLAM by the radar alone; standard deviations by the jackknife over 12 blocks of the drive.".to_owned(),
        ..Table::default()
    }
}
