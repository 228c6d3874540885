//! `gyre map EARLIER LATER`: the things that appeared or vanished between two drives through one
//! place.

use std::{
    io::Write,
    path::{Path, PathBuf},
    process::ExitCode,
};

use gyre_configuration::Configuration;
use gyre_datasets::ground_truth::read_trajectory;
use gyre_geometry::Pose;
use gyre_localisation::{Localiser, PlacedDrive};
use gyre_mapping::{
    Change, ChangeKind, Changes, Evidence, Overlay, Survey, changes, legible, map_png,
};
use gyre_results::{Content, Out, map_options};
use gyre_slam::{Keyframe, RecordReader, records_path};
use gyre_storage as storage;
use gyre_terminal::{Failure, print};
use serde::Serialize;

use super::{MapArguments, keyframes, placing};
use crate::localise::searched_map;

const TABLE: &str = "changes.csv";
/// The map of the later drive with the changes in it.
const PICTURE: &str = "changes.png";
/// Changes that are printed: the most certain ones.
const PRINTED: usize = 20;

/// The report, as `--json` prints it.
#[derive(Serialize)]
struct Report<'a> {
    appeared: usize,
    gone: usize,
    #[serde(flatten)]
    found: &'a Changes,
    table: PathBuf,
    picture: PathBuf,
}

/// Compares a later run with an earlier run or map, and writes `changes.csv` and `changes.png`, all
/// in the frame of the earlier one.
pub fn compare(arguments: &MapArguments, later: &Path) -> Result<ExitCode, Failure> {
    let (earlier, out) = (&arguments.run, &arguments.out);
    let mut keyframes = super::open(later)?;
    let graph = placing::read_graph(later, keyframes.len())?;
    let configuration = super::configuration(later)?;
    let mut localiser = open_earlier(earlier, &configuration)?;
    // Before the search, which takes minutes for a long drive. Drives that are refused make no
    // folder.
    let lock = || Out::lock_for(out, Content::MAP);
    let locked = out.exists().then(lock).transpose()?;
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
    let _locked = locked.map_or_else(lock, Ok)?;
    storage::write(&out.join(TABLE), table(&found.changes)?)?;
    let picture = draw(out, &mut keyframes, &placed.poses, &configuration, &found)?;
    storage::write(&out.join(PICTURE), picture)?;
    report(arguments, &found)?;
    Ok(ExitCode::SUCCESS)
}

/// Opens the earlier drive, a run with keyframes or the folder of a map.
fn open_earlier(earlier: &Path, configuration: &Configuration) -> Result<Localiser, Failure> {
    let has_keyframes = super::exists(&records_path::<Keyframe>(earlier))?;
    let is_run = super::exists(&earlier.join("config.toml"))?;
    match has_keyframes || is_run {
        true => {
            let mut of_run = super::open(earlier)?;
            let poses = read_trajectory(&super::trajectory_of(earlier))?;
            searched_map::plan(keyframes::placed(&mut of_run, &poses)?, configuration)
        }
        false => searched_map::open(earlier, configuration),
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
    for (index, pose) in placed.poses.iter().enumerate() {
        if placed.is_near_fix(index) {
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

/// Returns the picture of the later drive in the frame of the earlier one, with the changes in it.
fn draw(
    out: &Path,
    keyframes: &mut RecordReader<Keyframe>,
    poses: &[Pose],
    configuration: &Configuration,
    found: &Changes,
) -> Result<Vec<u8>, Failure> {
    let options = legible(map_options(configuration), poses);
    let mut evidence = Evidence::new(&options, out)?;
    for (index, pose) in poses.iter().enumerate() {
        evidence.draw(&keyframes.read(index)?, pose)?;
    }
    let overlay = Overlay {
        trajectory: &[poses],
        changes: &found.changes,
        ..Overlay::default()
    };
    Ok(map_png(&mut evidence, &overlay)?)
}

fn report(arguments: &MapArguments, found: &Changes) -> Result<(), Failure> {
    let count = |kind| found.changes.iter().filter(|it| it.kind == kind).count();
    let report = Report {
        appeared: count(ChangeKind::Appeared),
        gone: count(ChangeKind::Gone),
        found,
        table: arguments.out.join(TABLE),
        picture: arguments.out.join(PICTURE),
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
    let [table, picture] = [&report.table, &report.picture].map(|path| path.display());
    print::line(format_args!("{table}, {picture}"))
}
