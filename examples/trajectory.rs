//! Estimates the trajectory of a recording and prints it in TUM format (time, x, y, z and a
//! quaternion; s, m).
//!
//! ```sh
//! cargo run --release -p gyre-matching --example trajectory -- DATASET [CONFIG.toml] > trajectory.tum
//! ```

use std::{env, error::Error, fs, io, path::Path};

use gyre_datasets::{DatasetOptions, ScanSamples, write_tum};
use gyre_geometry::OwnedScan;
use gyre_matching::odometry::{Odometry, OdometryConfig};
use gyre_radar::Trajectory;
use serde::Deserialize;

#[derive(Default, Deserialize)]
#[serde(default)]
struct Config {
    dataset: DatasetOptions,
    #[serde(flatten)]
    odometry: OdometryConfig,
}

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<String> = env::args().skip(1).collect();
    let folder = arguments
        .first()
        .ok_or("usage: trajectory DATASET [CONFIG.toml]")?;
    let config: Config = match arguments.get(1) {
        Some(path) => toml::from_str(&fs::read_to_string(path)?)?,
        None => Config::default(),
    };

    let mut dataset = gyre_datasets::open(Path::new(folder), &config.dataset)?;
    let mut scan = OwnedScan::with_limits(dataset.limits());
    let mut odometry = Odometry::new(&config.odometry)?;
    let sensors = config.odometry.sensors.sampled();
    let samples = ScanSamples::open(&sensors, Path::new(folder), dataset.as_mut())?;
    let (mut stamps, mut poses) = (Vec::new(), Vec::new());
    for index in 0..dataset.len() {
        match dataset.read(index, scan.slot()) {
            Ok(geometry) => scan.geometry = geometry,
            Err(error) => {
                eprintln!("skipped: {error}");
                continue;
            }
        }
        let samples = samples.of(dataset.as_ref(), scan.view().span_ns());
        let registered = odometry.register(&scan.view(), &samples)?;
        stamps.push(scan.geometry.stamp_ns);
        poses.push(registered.pose.motion);
    }
    let trajectory = Trajectory::timed(stamps, poses);
    write_tum(&trajectory, &mut io::stdout().lock())?;
    Ok(())
}
