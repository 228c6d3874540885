//! Pairs of simulated drives, registered, and kept.

use std::{collections::BTreeMap, path::{Path, PathBuf}, env, fs};

use gyre_datasets::write_tum;
use gyre_geometry::{pose, OwnedScan};
use gyre_matching::odometry::{Odometry, OdometryConfig};
use gyre_radar::Trajectory;
use gyre_slam::{estimation::{Constraint, G2o}, localisation::{DriveSearch, Localiser, Map}, Keyframe, KeyframeBuilder, RecordLog, RecordReader, ScanPose};
use gyre_worlds::{drive::{DriveConfig, DriveKind}, weather::WeatherConfig, SimulatedDrive, SimulationConfig};

use crate::{Outcome, Pair};

impl Pair {
    /// Simulates and registers both drives: `RADAR:SEED:WEATHER:SCANS`.
    pub fn simulate(name: &str) -> Outcome<Self> {
        let parts: Vec<&str> = name.split(':').collect();
        let [radar, seed, weather, scans] = parts[..] else {
            return Err(format!("{name} is not RADAR:SEED:WEATHER:SCANS").into());
        };
        let (seed, scans): (u64, usize) = (seed.parse()?, scans.parse()?);
        let folder = tempfile::tempdir()?;
        let mut config = SimulationConfig {
            seed: 2 * seed,
            ..SimulationConfig::default()
        };
        let profile = toml::from_str::<BTreeMap<String, _>>(&format!("profile = \"{radar}\""))?;
        config.sensor.profile = profile["profile"];
        config.town.seed = Some(seed);
        let (files, pace) = trajectories(seed, scans, folder.path())?;
        config.town.streets = files.to_vec();
        config.drive = DriveConfig::along_file(files[0].clone());
        config.scans = Some(scans);
        let mut second = SimulationConfig {
            seed: 2 * seed + 1,
            scans: Some((scans as f64 / pace) as usize),
            drive: DriveConfig::along_file(files[1].clone()),
            ..config.clone()
        };
        second.town.changes_seed = Some(1000 + seed);
        if weather == "rain" {
            second.weather.push(WeatherConfig {
                rain_mm_h: 10.0,
                ..WeatherConfig::default()
            });
        }
        let drives = [SimulatedDrive::new(&config)?, SimulatedDrive::new(&second)?];
        let simulators = drives.each_ref().map(|drive| drive.simulator().clone());
        let keyframes = match cached(name)? {
            Some(keyframes) => keyframes,
            None => {
                let keyframes = placed([registered(&drives[0])?, registered(&drives[1])?])?;
                keep(name, &keyframes)?;
                keyframes
            }
        };
        Ok(Self {
            drives: simulators,
            keyframes,
        })
    }
}

/// Writes the trajectories of both drives through the town of a seed, the first one of at least so
/// many scans, and returns the pace of the second one over that of the first one.
fn trajectories(seed: u64, scans: usize, folder: &Path) -> Outcome<([PathBuf; 2], f64)> {
    let drive = DriveConfig {
        kind: DriveKind::Town,
        length_m: (4.0 * scans as f64).max(300.0),
        ..DriveConfig::default()
    };
    let path = drive.path(seed, None)?;
    // Up to half a metre to either side of the first one, at 0.8 to 1.2 times its pace.
    let [aside_m, pace] = match seed % 4 {
        0 => [0.5, 0.8],
        1 => [-0.5, 1.2],
        2 => [0.3, 1.1],
        _ => [-0.3, 0.9],
    };
    let write = |name: &str, aside_m: f64, pace: f64| -> Outcome<PathBuf> {
        let file = folder.join(name);
        let steps = 0..(10.0 * path.duration_s()) as i64;
        let stamp_ns = |step: i64| (step as f64 * 1e8 / pace) as i64;
        let at = |step: i64| path.pose(0.1 * step as f64) * pose(0.0, aside_m, 0.0);
        let trajectory = Trajectory {
            stamp_ns: Some(steps.clone().map(stamp_ns).collect()),
            poses: steps.map(at).collect(),
        };
        let mut text = Vec::new();
        write_tum(&trajectory, &mut text)?;
        fs::write(&file, text)?;
        Ok(file)
    };
    let first = write("first.tum", 0.0, 1.0)?;
    Ok(([first, write("second.tum", aside_m, pace)?], pace))
}

/// Registers a drive by odometry, and returns its keyframes.
fn registered(drive: &SimulatedDrive) -> Outcome<Vec<Keyframe>> {
    let options = drive.dataset_options();
    let mut dataset = gyre_datasets::open_source(Box::new(drive.renderer()), &options)?;
    let mut odometry = Odometry::new(&OdometryConfig::default())?;
    let mut builder = KeyframeBuilder::default();
    let mut scan = OwnedScan::with_limits(dataset.limits());
    let mut keyframes = Vec::new();
    for index in 0..dataset.len() {
        scan.geometry = dataset.read(index, scan.slot())?;
        let registered = odometry.register(&scan.view(), &[])?;
        let keyframe = builder.next(&ScanPose {
            seq: registered.seq,
            scan: index as u64,
            stamp_ns: scan.geometry.stamp_ns,
            pose: registered.pose,
            motion: registered.motion,
            interval_s: registered.interval_ns as f64 * 1e-9,
        });
        keyframes.extend(keyframe.map(|keyframe| Keyframe {
            points: odometry.points().to_vec(),
            ..keyframe
        }));
    }
    Ok(keyframes)
}

/// Finds the second drive in the map of the first one, and returns the keyframes of both in its
/// frame.
fn placed([first, second]: [Vec<Keyframe>; 2]) -> Outcome<[Vec<Keyframe>; 2]> {
    let config = OdometryConfig::default();
    let mut localiser =
        Localiser::new(Map::new(first)?, &config.refinement, config.points.capacity)?;
    let mut search = DriveSearch::default();
    for keyframe in &second {
        search.add(&mut localiser, keyframe);
    }
    let motions = second.iter().skip(1).enumerate();
    let drive = G2o {
        poses: second.iter().map(|it| it.pose.motion).collect(),
        constraints: motions
            .map(|(last, it)| Constraint::odometry(last, it.motion))
            .collect(),
    };
    let placed = search
        .place(&drive)?
        .ok_or("the second drive is not on the first one")?;
    let path_m: Vec<f64> = second.iter().map(|it| it.path_m).collect();
    let near = gyre_changes::near_fixes(&path_m, &placed);
    let second = second.into_iter().zip(&placed.poses).enumerate();
    let second = second.filter(|(index, _)| near[*index]);
    let second = second.map(|(_, (mut keyframe, pose))| {
        keyframe.pose.motion = *pose;
        keyframe
    });
    Ok([localiser.map().keyframes().to_vec(), second.collect()])
}

/// The files of a pair that is kept.
fn cache(name: &str) -> Option<[PathBuf; 2]> {
    let folder = PathBuf::from(env::var_os("CHANGES_CACHE")?);
    let name = name.replace(':', "-");
    Some(["first", "second"].map(|which| folder.join(format!("{name}-{which}.log"))))
}

fn cached(name: &str) -> Outcome<Option<[Vec<Keyframe>; 2]>> {
    let Some(files) = cache(name).filter(|files| files.iter().all(|file| file.exists())) else {
        return Ok(None);
    };
    let read = |file: &Path| -> Outcome<Vec<Keyframe>> {
        let mut reader = RecordReader::<Keyframe>::open_file(file)?;
        (0..reader.len())
            .map(|index| Ok(reader.read(index)?))
            .collect()
    };
    Ok(Some([read(&files[0])?, read(&files[1])?]))
}

fn keep(name: &str, keyframes: &[Vec<Keyframe>; 2]) -> Outcome<()> {
    let Some(files) = cache(name) else {
        return Ok(());
    };
    for (file, keyframes) in files.iter().zip(keyframes) {
        let mut log = RecordLog::<Keyframe>::open_file(file)?;
        log.cut(0)?;
        for keyframe in keyframes {
            log.append(keyframe)?;
        }
        log.end()?;
    }
    Ok(())
}
