//! `gyre-changes EARLIER LATER`: what has appeared and gone between two drives through one place.

use std::{fs, io::Write, path::{Path, PathBuf}, process::ExitCode};

use clap::Parser;
use gyre_changes::{Change, ChangeKind, Changes, Survey, changes, near_fixes};
use gyre_configuration::{Configuration, terminal::{Failure, print}};
use gyre_slam::{localisation::{Localiser, PlacedDrive}, Keyframe, RecordReader, records_path};
use gyre_storage::{self as storage, StorageError};
use gyre_tools::maps::{localise, map::{self, placing}};
use serde::Serialize;

/// The table of all changes.
const TABLE: &str = "changes.csv";
/// Changes that are printed: the most certain ones.
const PRINTED: usize = 20;

/// Reports the parked cars that have come and gone between two drives through one place.
#[derive(Debug, Parser)]
#[command(version, about)]
struct Arguments {
    /// The results of the earlier run, with journal/keyframes.log, or the folder of a map.
    earlier: PathBuf,
    /// The results of the later run, with journal/keyframes.log.
    later: PathBuf,
    /// The folder of changes.csv.
    #[arg(long)]
    out: PathBuf,
    /// Print the changes as JSON instead of sentences.
    #[arg(long)]
    json: bool,
}

/// The report, as `--json` prints it.
#[derive(Serialize)]
struct Report<'a> {
    appeared: usize,
    gone: usize,
    #[serde(flatten)]
    found: &'a Changes,
    table: PathBuf,
}

fn main() -> ExitCode {
    match gyre_configuration::terminal::parse::<Arguments>("gyre-changes") {
        Ok(arguments) => gyre_configuration::terminal::report("gyre-changes", compare(&arguments)),
        Err(code) => code,
    }
}

/// Compares a later run with an earlier run or map, and writes `changes.csv` in the frame of the
/// earlier one.
///
/// # Errors
/// Runs without keyframes, and drives that have no place in common.
fn compare(arguments: &Arguments) -> Result<ExitCode, Failure> {
    let (earlier, later) = (&arguments.earlier, &arguments.later);
    let out = &arguments.out;
    let mut keyframes = map::open(later)?;
    let graph = placing::read_graph(later, keyframes.len())?;
    let configuration = map::configuration(later)?;
    let mut localiser = open_earlier(earlier, &configuration)?;
    let placed = placing::place(&graph, &mut keyframes, &mut localiser, [later, earlier])?;
    let surveys = survey(&localiser, &mut keyframes, &placed)?;
    let found = changes(&surveys[0], &surveys[1])?;
    if found.compared_m2 == 0.0 {
        return Err(format!(
            "{} and {} have looked at no place in common often enough to compare it",
            earlier.display(),
            later.display()
        )
        .into());
    }
    fs::create_dir_all(out).map_err(StorageError::at("create", out))?;
    storage::write(&out.join(TABLE), table(&found.changes)?)?;
    report(arguments, &found)?;
    Ok(ExitCode::SUCCESS)
}

/// Opens the earlier drive, a run with keyframes or the folder of a map.
fn open_earlier(earlier: &Path, configuration: &Configuration) -> Result<Localiser, Failure> {
    let has_keyframes = map::exists(&records_path::<Keyframe>(earlier))?;
    let is_run = map::exists(&earlier.join("config.toml"))?;
    match has_keyframes || is_run {
        true => {
            let mut of_run = map::open(earlier)?;
            let poses = map::Poses::read(earlier, None)?;
            localise::plan(map::placed(&mut of_run, &poses)?, configuration)
        }
        false => localise::localiser(earlier, configuration),
    }
}

/// Draws both drives. Of the later one, keyframes whose place in the earlier one is not known are
/// left out.
fn survey(
    localiser: &Localiser,
    keyframes: &mut RecordReader<Keyframe>,
    placed: &PlacedDrive,
) -> Result<[Survey; 2], Failure> {
    let (mut before, mut after) = (Survey::default(), Survey::default());
    for keyframe in localiser.map().keyframes() {
        before.add(keyframe, &keyframe.pose.motion);
    }
    let mut path_m = Vec::new();
    for index in 0..placed.poses.len() {
        path_m.push(Keyframe::without_points(keyframes, index)?.path_m);
    }
    let near = near_fixes(&path_m, placed);
    for (index, pose) in placed.poses.iter().enumerate() {
        if near[index] {
            after.add(&keyframes.read(index)?, pose);
        }
    }
    Ok([before, after])
}

/// Returns `changes.csv`.
fn table(changes: &[Change]) -> Result<Vec<u8>, Failure> {
    let mut text = b"change,kind,x_m,y_m,yaw_rad,length_m,width_m,confidence\n".to_vec();
    for (number, it) in (1..).zip(changes) {
        writeln!(
            text,
            "{number},{},{:.2},{:.2},{:.3},{:.2},{:.2},{:.3}",
            it.kind, it.x_m, it.y_m, it.yaw_rad, it.length_m, it.width_m, it.confidence
        )?;
    }
    Ok(text)
}

/// Prints the changes.
fn report(arguments: &Arguments, found: &Changes) -> Result<(), Failure> {
    let count = |kind| found.changes.iter().filter(|it| it.kind == kind).count();
    let report = Report {
        appeared: count(ChangeKind::Appeared),
        gone: count(ChangeKind::Gone),
        found,
        table: arguments.out.join(TABLE),
    };
    if arguments.json {
        return print::line(serde_json::to_string_pretty(&report)?);
    }
    print::line(format_args!(
        "{} things have appeared and {} have gone on {:.0} m² that both drives have looked at",
        report.appeared, report.gone, found.compared_m2
    ))?;
    for it in found.changes.iter().take(PRINTED) {
        print::line(format_args!(
            "{}: {:.1} x {:.1} m at ({:.1}, {:.1}), {:.0} % certain",
            it.kind,
            it.length_m,
            it.width_m,
            it.x_m,
            it.y_m,
            100.0 * it.confidence
        ))?;
    }
    if found.changes.len() > PRINTED {
        let more = found.changes.len() - PRINTED;
        print::line(format_args!("and {more} less certain ones"))?;
    }
    print::line(report.table.display())
}
