//! Estimates the motion between two scans of a recording.
//!
//!     cargo run --release -p gyre-matching --example one_scan -- DATASET [EARLIER LATER]

use std::{env, error::Error, path::Path};

use gyre_datasets::DatasetOptions;
use gyre_geometry::{OwnedScan, xy_yaw};
use gyre_matching::odometry::{Odometry, OdometryConfig};

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<String> = env::args().skip(1).collect();
    let folder = arguments
        .first()
        .ok_or("usage: one_scan DATASET [EARLIER LATER]")?;
    let number = |place: usize| arguments.get(place).map(|text| text.parse::<usize>());
    let scans = [
        number(1).transpose()?.unwrap_or(0),
        number(2).transpose()?.unwrap_or(1),
    ];

    let mut dataset = gyre_datasets::open(Path::new(folder), &DatasetOptions::default())?;
    let mut scan = OwnedScan::with_limits(dataset.limits());
    let mut odometry = Odometry::new(&OdometryConfig::default())?;
    for index in scans {
        scan.geometry = dataset.read(index, scan.slot())?;
        let registered = odometry.register(&scan.view(), &[])?;
        let [x_m, y_m, yaw_rad] = xy_yaw(&registered.motion.motion);
        let sigma = registered
            .motion
            .covariance
            .diagonal()
            .map(|variance| variance.sqrt());
        println!(
            "scan {index}: {:?}, {x_m:.3} m ahead, {y_m:.3} m to the left, {:.3} deg counter-clockwise \
             (+- {:.3} m, {:.3} m, {:.3} deg)",
            registered.outcome,
            yaw_rad.to_degrees(),
            sigma.x,
            sigma.y,
            sigma.z.to_degrees(),
        );
    }
    Ok(())
}
