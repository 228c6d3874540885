//! `gyre-lab localisation`: the first fix by each scan alone, and tracking, against the ground
//! truth.

mod figures;

use std::{path::PathBuf, process::ExitCode};

use clap::Args;
use figures::{First, FixError, Tracking};
use gyre_configuration::{Configuration, terminal::Failure};
use gyre_geometry::{Pose, SparsePoint};
use gyre_slam::localisation::{Fix, Localiser, Status};
use gyre_tools::maps::localise::{Scans, localiser};
use rustix::time::{ClockId, clock_gettime};

use crate::{recording::Track, report::{make_folder, publish}};

/// A scan is on the map within this distance from a keyframe, m, and outside beyond the other.
const ON_MAP_M: f64 = 5.0;
const OUTSIDE_M: f64 = 30.0;

/// The arguments of `gyre-lab localisation`.
#[derive(Debug, Args)]
pub struct LocalisationArguments {
    /// The configuration, a TOML file: its odometry.
    pub configuration: PathBuf,
    /// The folder of the map, of `gyre map --format folder`.
    #[arg(long)]
    pub map: PathBuf,
    /// The ground truth of the map's drive.
    #[arg(long, value_name = "FILE")]
    pub map_truth: PathBuf,
    /// The recording's folder.
    #[arg(long)]
    pub data: PathBuf,
    /// The ground truth of the recording, in the same frame as that of the map.
    #[arg(long, value_name = "FILE")]
    pub truth: PathBuf,
    /// Look up every Nth scan alone. All are tracked.
    #[arg(long, default_value = "1")]
    pub every: std::num::NonZeroUsize,
    /// A fix is wrong if it is farther from the ground truth, m.
    #[arg(long, default_value = "2")]
    pub wrong_m: f64,
    /// Override a key, as in source.first=100; may be repeated.
    #[arg(long = "set", value_name = "KEY=VALUE")]
    pub set: Vec<String>,
    /// The folder of localisation.md, localisation.json.
    #[arg(long, default_value = "out/localisation")]
    pub out: PathBuf,
}

/// Looks scans up alone, tracks all, and compares with the truth.
///
/// # Errors
/// A map, a recording or a ground truth that cannot be used.
pub fn localisation(arguments: &LocalisationArguments) -> Result<ExitCode, Failure> {
    let configuration = Configuration::read(&arguments.configuration, &arguments.set)?;
    let configuration = configuration.streaming(Some(&arguments.data));
    let mut localiser = localiser(&arguments.map, &configuration)?;
    let truth = Truth::read(arguments, &localiser)?;
    let mut scans = Scans::open(&configuration)?;
    make_folder(&arguments.out)?;
    let mut firsts = [First::new("whole scan"), First::new("half of it hidden")];
    let mut tracking = Tracking::default();
    while let Some(scan) = scans.register_next()? {
        let observation = &scan.observation;
        let Some(pose) = truth.drive.pose(observation.stamp_ns) else {
            continue;
        };
        let away_m = truth.away_m(&pose);
        let alone = [observation.points.to_vec(), half_hidden(observation.points)];
        for (first, points) in firsts.iter_mut().zip(alone) {
            if scan.number % arguments.every == 0 {
                let before_ns = cpu_ns();
                let fix = localiser.find(&points, &observation.twist);
                let row = truth.row(&pose, fix.as_ref(), &localiser);
                first.add(away_m, row, arguments.wrong_m, cpu_ns() - before_ns);
            }
        }
        if scan.starts {
            localiser.reset();
        }
        let before_ns = cpu_ns();
        let found = localiser.locate(observation);
        let spent_ns = cpu_ns() - before_ns;
        let is_fix = matches!(found.status, Status::Found | Status::Tracked);
        let row = truth.row(&pose, found.fix.as_ref().filter(|_| is_fix), &localiser);
        tracking.add(observation.stamp_ns, away_m, found.status, row, spent_ns);
    }
    let tables = [figures::first_table(&firsts), tracking.table()];
    publish("localisation", &tables, &arguments.out)?;
    Ok(ExitCode::SUCCESS)
}

/// The points of a scan whose left half is hidden.
fn half_hidden(points: &[SparsePoint]) -> Vec<SparsePoint> {
    let is_seen = |point: &&SparsePoint| point.y_m <= 0.0;
    points.iter().filter(is_seen).copied().collect()
}

/// The true poses of the map's keyframes, and of the drive.
struct Truth {
    keyframes: Vec<Option<Pose>>,
    drive: Track,
}

impl Truth {
    fn read(arguments: &LocalisationArguments, localiser: &Localiser) -> Result<Self, Failure> {
        let map = Track::read(&arguments.map_truth)?;
        let keyframes = localiser.map().keyframes().iter();
        let keyframes = keyframes
            .map(|keyframe| map.pose(keyframe.stamp_ns))
            .collect();
        let drive = Track::read(&arguments.truth)?;
        Ok(Self { keyframes, drive })
    }

    /// The distance from the nearest keyframe, m.
    fn away_m(&self, pose: &Pose) -> f64 {
        let distance_m =
            |keyframe: &Pose| (keyframe.translation.vector - pose.translation.vector).norm();
        let all = self.keyframes.iter().flatten().map(distance_m);
        all.fold(f64::INFINITY, f64::min)
    }

    /// Compares a fix with the truth relative to its keyframe; `None` without both.
    fn row(&self, pose: &Pose, fix: Option<&Fix>, localiser: &Localiser) -> Option<FixError> {
        let fix = fix?;
        let of_keyframe = self.keyframes[fix.keyframe]?;
        let expected = localiser.map().pose(fix.keyframe) * of_keyframe.inv_mul(pose);
        let error = fix.pose.error(&expected);
        let inverse = fix.pose.covariance.try_inverse()?;
        Some(FixError {
            away_m: error.xy().norm(),
            yaw_deg: error.z.to_degrees().abs(),
            nees: (error.transpose() * inverse * error).x / 3.0,
        })
    }
}

/// Where a scan is by the truth.
fn is_on_map(away_m: f64) -> Option<bool> {
    match away_m {
        near if near <= ON_MAP_M => Some(true),
        far if far > OUTSIDE_M => Some(false),
        _ => None,
    }
}

/// The processor time of this thread, ns.
fn cpu_ns() -> u64 {
    let time = clock_gettime(ClockId::ThreadCPUTime);
    (time.tv_sec * 1_000_000_000 + time.tv_nsec) as u64
}
