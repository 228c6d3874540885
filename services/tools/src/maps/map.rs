//! `gyre map`: draws the map of a run.

mod arguments;
pub mod placing;
mod poses;

use std::{
    collections::BTreeMap,
    path::{Path, PathBuf},
};

use gyre_configuration::{
    Configuration,
    terminal::{Failure, print},
};
use gyre_geometry::Pose;
use gyre_results::{Content, Out, georeference, map_options, require_results};
use gyre_slam::{
    Keyframe, RecordReader,
    localisation::Map,
    mapping::{
        Drawing, Evidence, MapOptions, Origin, TileSource, write_geotiff, write_pgm,
        write_web_tiles,
    },
    records_path,
};
use gyre_storage::StorageError;

use crate::maps::folder;
pub use arguments::{MapArguments, MapFormat};
pub use poses::Poses;

/// The corrected trajectory, and the trajectory of odometry.
const CORRECTED: &str = "trajectory_slam.tum";
const ODOMETRY: &str = "trajectory.tum";

/// Draws the keyframes of a run along its trajectory, and writes the map in the forms that were
/// asked for.
pub fn map(arguments: &MapArguments) -> Result<(), Failure> {
    let mut drawing = match &arguments.extend {
        Some(map) => placing::extend(arguments, map)?,
        None => draw_run(arguments)?,
    };
    let (keyframes, tiles) = (drawing.keyframes(), drawing.evidence().tiles().len());
    let out = arguments.out.display();
    print::line(format_args!(
        "{keyframes} keyframes in {tiles} tiles, in {out}"
    ))
}

fn draw_run(arguments: &MapArguments) -> Result<Drawing, Failure> {
    let mut keyframes = open(&arguments.run)?;
    let poses = Poses::read(&arguments.run, arguments.trajectory.as_ref())?;
    let loops = placing::used_loops(&arguments.run)?;
    let configuration = configuration(&arguments.run)?;
    let _locked = Out::lock_for(&arguments.out, Content::MAP)?;
    let options = MapOptions {
        cell_m: arguments.cell_m,
        ..map_options(&configuration)
    };
    let mut drawing = Drawing::new(&options, &arguments.out)?;
    let lines = draw(&mut keyframes, &poses, &loops, &mut drawing)?;
    let (count, total) = (drawing.keyframes(), keyframes.len());
    if count < total {
        let (left_out, file) = (total - count, poses.path.display());
        print::note(format_args!(
            "{left_out} of {total} keyframes have no pose in {file} and are left out"
        ));
    }
    let (out, origin) = (&arguments.out, origin(arguments)?);
    if arguments.format.contains(&MapFormat::Folder) {
        let kept = placed(&mut keyframes, &poses)?;
        folder::write(out, &kept, drawing.evidence(), origin)?;
    }
    export(arguments, origin, &mut drawing, &lines)?;
    Ok(drawing)
}

/// Draws the keyframes of a run along its trajectory, whose frame has the pose `placed` in the
/// frame of the drawing. What does not fit into memory lies in a file in `folder`, which has no
/// name.
pub fn evidence(run: &Path, folder: &Path, placed: &Pose) -> Result<Evidence, Failure> {
    let mut keyframes = open(run)?;
    let poses = Poses::read(run, None)?;
    let mut evidence = Evidence::new(&map_options(&configuration(run)?), folder)?;
    for index in 0..keyframes.len() {
        let keyframe = keyframes.read(index)?;
        if let Some(pose) = poses.of(&keyframe) {
            evidence.draw(&keyframe, &(placed * pose))?;
        }
    }
    Ok(evidence)
}

/// Returns the keyframes that have a pose, with their poses in the frame of the first one.
pub fn placed(keyframes: &mut RecordReader<Keyframe>, poses: &Poses) -> Result<Map, Failure> {
    let (mut kept, mut first): (_, Option<Pose>) = (Vec::new(), None);
    for index in 0..keyframes.len() {
        let mut keyframe = keyframes.read(index)?;
        if let Some(pose) = poses.of(&keyframe) {
            keyframe.pose.motion = first.get_or_insert(pose).inv_mul(&pose);
            kept.push(keyframe);
        }
    }
    Ok(Map::new(kept)?)
}

/// Returns the place of the map on the earth: the given place, else the place of the run by GNSS.
/// Another trajectory has a frame of its own, and so has odometry once fixes have corrected it.
fn origin(arguments: &MapArguments) -> Result<Option<Origin>, Failure> {
    let is_corrected = trajectory_of(&arguments.run).ends_with(CORRECTED);
    let is_of_run = arguments.trajectory.is_none() && is_corrected;
    match arguments.origin {
        None if is_of_run => georeference(&arguments.run),
        given => Ok(given),
    }
}

/// Returns the trajectory of a run: the corrected one, if it has one.
fn trajectory_of(run: &Path) -> PathBuf {
    let corrected = run.join(CORRECTED);
    match corrected.is_file() {
        true => corrected,
        false => run.join(ODOMETRY),
    }
}

/// Returns whether a file exists. Of another user's run that may be unknown.
pub fn exists(path: &Path) -> Result<bool, StorageError> {
    path.try_exists().map_err(StorageError::at("read", path))
}

pub fn configuration(run: &Path) -> Result<Configuration, Failure> {
    Ok(Configuration::read(&run.join("config.toml"), &[])?)
}

pub fn open(run: &Path) -> Result<RecordReader<Keyframe>, Failure> {
    require_results(run)?;
    let path = records_path::<Keyframe>(run);
    if exists(&path)? {
        return Ok(RecordReader::open(run)?);
    }
    let path = path.display();
    Err(format!("{path} does not exist: a run keeps keyframes with --set slam.kind=graph").into())
}

#[derive(Default)]
struct Lines {
    trajectory: Vec<Pose>,
    loops: Vec<[Pose; 2]>,
}

/// Draws all keyframes that have a pose. `loops` are between keyframes.
fn draw(
    keyframes: &mut RecordReader<Keyframe>,
    poses: &Poses,
    loops: &[[usize; 2]],
    drawing: &mut Drawing,
) -> Result<Lines, Failure> {
    let (mut placed, mut span) = (BTreeMap::new(), None);
    for index in 0..keyframes.len() {
        let keyframe = keyframes.read(index)?;
        let Some(pose) = poses.of(&keyframe) else {
            continue;
        };
        drawing.draw(&keyframe, &pose)?;
        placed.insert(index, pose);
        let last = poses.key(&keyframe);
        let (first, _) = span.unwrap_or((last, last));
        span = Some((first, last));
    }
    let end = |keyframe: usize| placed.get(&keyframe).copied();
    let both = |&[from, to]: &[usize; 2]| Some([end(from)?, end(to)?]);
    Ok(Lines {
        trajectory: span.map_or(Vec::new(), |span| poses.part(span)),
        loops: loops.iter().filter_map(both).collect(),
    })
}

fn export(
    arguments: &MapArguments,
    origin: Option<Origin>,
    drawing: &mut Drawing,
    lines: &Lines,
) -> Result<(), Failure> {
    let out = &arguments.out;
    for format in &arguments.format {
        match format {
            MapFormat::Folder => {}
            MapFormat::Png => {
                let png = drawing.png(&lines.trajectory, &lines.loops)?;
                gyre_storage::write(&out.join("map.png"), png)?;
            }
            MapFormat::Geotiff => write_geotiff(&out.join("map.tif"), drawing.evidence(), origin)?,
            MapFormat::Pgm => write_pgm(out, drawing.evidence())?,
            MapFormat::Web => write_web_tiles(&out.join("web"), drawing.evidence())?,
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use std::fs;

    use clap::ValueEnum;
    use gyre_datasets::ground_truth::write_tum_pose;
    use gyre_geometry::{SparsePoint, UncertainMotion, pose};
    use gyre_slam::{RecordLog, localisation, mapping::Map};

    use super::*;

    fn keyframe(seq: u64) -> Keyframe {
        let pose = UncertainMotion {
            motion: pose(2.0 * seq as f64, 0.0, 0.0),
            ..UncertainMotion::identity()
        };
        let points = vec![SparsePoint::from([20.0, 5.0, 0.0, 1.0, 0.0])];
        Keyframe {
            // The clock steps back before the third one.
            stamp_ns: 1_000_000_000 * [1, 2, 1, 2][seq as usize],
            ..Keyframe::standing(seq, pose, points)
        }
    }

    fn arguments(folder: &Path) -> MapArguments {
        MapArguments {
            run: folder.join("run"),
            out: folder.join("map"),
            format: MapFormat::value_variants().to_vec(),
            trajectory: None,
            extend: None,
            cell_m: 0.5,
            origin: None,
        }
    }

    /// The results of a run of four keyframes, where the trajectory lacks the last keyframe.
    fn run(folder: &Path) {
        fs::create_dir_all(folder.join("run/journal")).unwrap();
        let configuration = "[points]\nmax_range_m = 60.0\n";
        fs::write(folder.join("run/config.toml"), configuration).unwrap();
        let mut log = RecordLog::open(&folder.join("run")).unwrap();
        let mut tum = Vec::new();
        for seq in 0..4 {
            let keyframe = keyframe(seq);
            log.append(&keyframe).unwrap();
            if seq < 3 {
                let pose = pose(100.0 + 3.0 * seq as f64, 0.0, 0.0);
                write_tum_pose(keyframe.stamp_ns, &pose, &mut tum).unwrap();
            }
        }
        fs::write(folder.join("run/trajectory.tum"), tum).unwrap();
    }

    /// Writes a corrected trajectory that has the first keyframe alone.
    fn correct_first_keyframe(folder: &Path) {
        let mut tum = Vec::new();
        write_tum_pose(keyframe(0).stamp_ns, &pose(0.0, 0.0, 0.0), &mut tum).unwrap();
        fs::write(folder.join("run/trajectory_slam.tum"), tum).unwrap();
    }

    /// Writes the graph of the four keyframes, with an edge for each of these loops.
    fn write_graph(folder: &Path, loops: &[[usize; 2]]) {
        let vertices = (0..4).map(|k| format!("VERTEX_SE2 {k} {k} 0 0\n"));
        let odometry = (1..4).map(|k| [k - 1, k]);
        let edge = |[from, to]: [usize; 2]| format!("EDGE_SE2 {from} {to} 1 0 0 1 0 0 1 0 1\n");
        let edges = odometry.chain(loops.iter().copied()).map(edge);
        let graph: String = vertices.chain(edges).collect();
        fs::write(folder.join("run/graph.g2o"), graph).unwrap();
    }

    #[test]
    fn the_map_of_a_run_is_written_in_all_forms() {
        let folder = tempfile::tempdir().unwrap();
        run(folder.path());
        map(&arguments(folder.path())).unwrap();
        let out = folder.path().join("map");
        let opened = Map::open(&out).unwrap();
        assert_eq!(opened.keyframes(), 3);
        let kept = localisation::Map::open(&out).unwrap();
        assert_eq!(kept.keyframes().len(), 3);
        assert_eq!(kept.pose(2).translation.x, 6.0);
        let options = opened.options();
        assert_eq!((options.cell_m, options.reach_m), (0.5, 60.0));
        let names = "map.png map.tif map.pgm map.yaml web/tiles.json web/0/0/0.png";
        for name in names.split(' ') {
            assert!(out.join(name).is_file(), "{name}");
        }
    }

    #[test]
    fn a_map_with_other_files_among_its_tiles_is_refused_and_left_as_it_is() {
        let folder = tempfile::tempdir().unwrap();
        run(folder.path());
        map(&arguments(folder.path())).unwrap();
        let out = folder.path().join("map");
        fs::write(out.join("tiles/holiday.jpg"), "mine").unwrap();
        correct_first_keyframe(folder.path());
        let refused = map(&arguments(folder.path())).unwrap_err().to_string();
        assert!(refused.contains("holiday.jpg is no tile"), "{refused}");
        assert_eq!(Map::open(&out).unwrap().keyframes(), 3);
        let kept = localisation::Map::open(&out).unwrap();
        assert_eq!(kept.keyframes().len(), 3);
        // The corrected trajectory comes before the trajectory of odometry.
        fs::remove_file(out.join("tiles/holiday.jpg")).unwrap();
        map(&arguments(folder.path())).unwrap();
        assert_eq!(Map::open(&out).unwrap().keyframes(), 1);
    }

    #[test]
    fn a_folder_that_another_command_is_writing_is_left_to_it() {
        let folder = tempfile::tempdir().unwrap();
        run(folder.path());
        let (out, extended) = (folder.path().join("map"), folder.path().join("extended"));
        let refused = |arguments: &MapArguments| map(arguments).unwrap_err().to_string();
        let other = Out::lock_for(&out, Content::MAP).unwrap();
        let said = refused(&arguments(folder.path()));
        let process = format!("process {}", std::process::id());
        assert!(said.starts_with("another command is writing to") && said.contains(&process));
        assert!(!out.join("map.toml").exists());
        drop(other);
        map(&arguments(folder.path())).unwrap();
        assert_eq!(Map::open(&out).unwrap().keyframes(), 3);

        // It is known before the search for places.
        write_graph(folder.path(), &[]);
        let arguments = MapArguments {
            out: extended.clone(),
            extend: Some(out),
            ..arguments(folder.path())
        };
        let other = Out::lock_for(&extended, Content::MAP).unwrap();
        assert!(refused(&arguments).starts_with("another command"));
        drop(other);
        assert!(refused(&arguments).starts_with("no keyframe of"));
    }

    #[test]
    fn the_loops_of_the_run_are_drawn() {
        let folder = tempfile::tempdir().unwrap();
        run(folder.path());
        let picture = || {
            map(&arguments(folder.path())).unwrap();
            fs::read(folder.path().join("map/map.png")).unwrap()
        };
        let plain = picture();
        // The last keyframe is not in the trajectory.
        write_graph(folder.path(), &[[0, 3]]);
        assert!(picture() == plain);
        write_graph(folder.path(), &[[0, 2], [0, 3]]);
        assert!(picture() != plain);
    }

    #[test]
    fn a_run_without_keyframes_is_refused_with_what_to_do() {
        let folder = tempfile::tempdir().unwrap();
        let refused = map(&arguments(folder.path())).unwrap_err().to_string();
        let remedy =
            "keyframes.log does not exist: a run keeps keyframes with --set slam.kind=graph";
        assert!(refused.contains(remedy), "{refused}");
        assert!(!folder.path().join("map").exists());
    }
}
