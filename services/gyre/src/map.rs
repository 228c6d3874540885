//! `gyre map`: draws the map of a run.

use std::{path::Path, process::ExitCode};

use gyre_geometry::Pose;
use gyre_mapping::{
    Evidence, MapOptions, Overlay, map_png, write_geotiff, write_map, write_pgm, write_web_tiles,
};
use gyre_radar::{Trajectory, ground_truth::read_trajectory};
use gyre_slam::{Keyframe, RecordReader, records_path};

use crate::{
    Failure,
    cli::{MapArguments, MapFormat},
    configuration::Configuration,
    print,
};

/// The corrected trajectory, and that of odometry.
const CORRECTED: &str = "trajectory_slam.tum";
const ODOMETRY: &str = "trajectory.tum";
/// A pose belongs to a keyframe if it is this near in time: trajectories may be written in microseconds.
const SAME_TIME_NS: u64 = 1_000_000;

/// Draws the keyframes of a run along its trajectory, and writes the map in the forms that were asked for.
///
/// # Errors
/// A run without keyframes or without a trajectory, a folder that cannot be written.
pub fn map(arguments: &MapArguments) -> Result<ExitCode, Failure> {
    let mut keyframes = open(&arguments.run)?;
    let corrected = arguments.run.join(CORRECTED);
    let trajectory = match &arguments.trajectory {
        Some(path) => path.clone(),
        None if corrected.is_file() => corrected,
        None => arguments.run.join(ODOMETRY),
    };
    let poses = read_trajectory(&trajectory)?;
    gyre_storage::create_folder(&arguments.out)?;
    let mut evidence = Evidence::new(&options(arguments)?, &arguments.out)?;
    let mut drawn = Drawn::default();
    for index in 0..keyframes.len() {
        drawn.draw(&keyframes.read(index)?, &poses, &mut evidence)?;
    }
    let (count, total) = (drawn.poses.len(), keyframes.len());
    if count < total {
        print::note(format_args!(
            "{} of {total} keyframes have no pose in {} and are left out",
            total - count,
            trajectory.display()
        ));
    }
    write(arguments, &mut evidence, &drawn)?;
    print::line(format_args!(
        "{count} keyframes in {} tiles, in {}",
        evidence.tiles().len(),
        arguments.out.display()
    ))?;
    Ok(ExitCode::SUCCESS)
}

fn open(run: &Path) -> Result<RecordReader<Keyframe>, Failure> {
    let path = records_path::<Keyframe>(run);
    match path.is_file() {
        true => Ok(RecordReader::open(run)?),
        false => Err(format!(
            "{} does not exist: a run keeps keyframes with --set slam.kind=graph",
            path.display()
        )
        .into()),
    }
}

/// The options of the map: keyframes see as far as the run has extracted points.
fn options(arguments: &MapArguments) -> Result<MapOptions, Failure> {
    let configuration = Configuration::read(&arguments.run.join("config.toml"), &[])?;
    let points = configuration.odometry.points;
    Ok(MapOptions {
        cell_m: arguments.cell_m,
        near_m: points.min_range_m.into(),
        reach_m: points.max_range_m.into(),
        ..MapOptions::default()
    })
}

/// The poses of the keyframes in the map frame, which is that of the first keyframe.
#[derive(Default)]
struct Drawn {
    poses: Vec<Pose>,
    odometry: Vec<Pose>,
    first: Option<[Pose; 2]>,
}

impl Drawn {
    fn draw(
        &mut self,
        keyframe: &Keyframe,
        poses: &Trajectory,
        evidence: &mut Evidence,
    ) -> Result<(), Failure> {
        let Some(pose) = poses.near(keyframe.stamp_ns, SAME_TIME_NS) else {
            return Ok(());
        };
        let odometry = keyframe.pose.motion;
        let [first, first_odometry] = *self.first.get_or_insert([pose, odometry]);
        let pose = first.inv_mul(&pose);
        evidence.draw(keyframe, &pose)?;
        self.poses.push(pose);
        self.odometry.push(first_odometry.inv_mul(&odometry));
        Ok(())
    }

    /// The trajectory by odometry where it is another one.
    fn other_odometry(&self, cell_m: f64) -> &[Pose] {
        let mut pairs = self.poses.iter().zip(&self.odometry);
        let differs =
            pairs.any(|(a, b)| (a.translation.vector - b.translation.vector).norm() > cell_m);
        if differs { &self.odometry } else { &[] }
    }
}

fn write(arguments: &MapArguments, evidence: &mut Evidence, drawn: &Drawn) -> Result<(), Failure> {
    let out = &arguments.out;
    for format in &arguments.format {
        match format {
            MapFormat::Folder => {
                let made_by = concat!("gyre ", env!("CARGO_PKG_VERSION"));
                write_map(out, evidence, arguments.origin, made_by)?;
            }
            MapFormat::Png => {
                let overlay = Overlay {
                    trajectory: &drawn.poses,
                    odometry: drawn.other_odometry(arguments.cell_m),
                    loops: &[],
                };
                gyre_storage::write(&out.join("map.png"), map_png(evidence, &overlay)?)?;
            }
            MapFormat::Geotiff => write_geotiff(&out.join("map.tif"), evidence, arguments.origin)?,
            MapFormat::Pgm => write_pgm(out, evidence)?,
            MapFormat::Web => write_web_tiles(&out.join("web"), evidence)?,
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use std::fs;

    use gyre_geometry::{SparsePoint, Twist, UncertainMotion, pose};
    use gyre_mapping::Map;
    use gyre_radar::ground_truth::write_tum_pose;
    use gyre_slam::RecordLog;

    use super::*;

    fn keyframe(seq: u64) -> Keyframe {
        Keyframe {
            seq,
            scan: seq,
            stamp_ns: 1_000_000_000 * (seq as i64 + 1),
            pose: UncertainMotion {
                motion: pose(2.0 * seq as f64, 0.0, 0.0),
                ..UncertainMotion::identity()
            },
            motion: UncertainMotion::identity(),
            twist: Twist::default(),
            path_m: 0.0,
            points: vec![SparsePoint::from([20.0, 5.0, 0.0, 1.0, 0.0])],
        }
    }

    fn arguments(folder: &Path) -> MapArguments {
        MapArguments {
            run: folder.join("run"),
            out: folder.join("map"),
            format: vec![
                MapFormat::Folder,
                MapFormat::Png,
                MapFormat::Geotiff,
                MapFormat::Pgm,
                MapFormat::Web,
            ],
            trajectory: None,
            cell_m: 0.5,
            origin: None,
        }
    }

    /// The results of a run of four keyframes, of which the last one is not in the trajectory.
    fn run(folder: &Path) {
        fs::create_dir_all(folder.join("run/journal")).unwrap();
        fs::write(
            folder.join("run/config.toml"),
            "[points]\nmax_range_m = 60.0\n",
        )
        .unwrap();
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

    #[test]
    fn the_map_of_a_run_is_written_in_all_forms() {
        let folder = tempfile::tempdir().unwrap();
        run(folder.path());
        map(&arguments(folder.path())).unwrap();
        let out = folder.path().join("map");
        let opened = Map::open(&out).unwrap();
        assert_eq!(opened.keyframes(), 3);
        assert_eq!(
            (opened.options().cell_m, opened.options().reach_m),
            (0.5, 60.0)
        );
        for name in [
            "map.png",
            "map.tif",
            "map.pgm",
            "map.yaml",
            "web/tiles.json",
            "web/0/0/0.png",
        ] {
            assert!(out.join(name).is_file(), "{name}");
        }
    }

    #[test]
    fn the_corrected_trajectory_comes_before_that_of_odometry() {
        let folder = tempfile::tempdir().unwrap();
        run(folder.path());
        let mut tum = Vec::new();
        write_tum_pose(keyframe(0).stamp_ns, &pose(0.0, 0.0, 0.0), &mut tum).unwrap();
        fs::write(folder.path().join("run/trajectory_slam.tum"), tum).unwrap();
        map(&arguments(folder.path())).unwrap();
        assert_eq!(
            Map::open(&folder.path().join("map")).unwrap().keyframes(),
            1
        );
    }

    #[test]
    fn a_run_without_keyframes_is_refused_with_what_to_do() {
        let folder = tempfile::tempdir().unwrap();
        let refused = map(&arguments(folder.path())).unwrap_err().to_string();
        assert!(
            refused.contains(
                "keyframes.log does not exist: a run keeps keyframes with --set slam.kind=graph"
            ),
            "{refused}"
        );
        assert!(!folder.path().join("map").exists());
    }
}
