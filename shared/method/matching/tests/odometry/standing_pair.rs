//! Two scans of a standing vehicle, in both forms of MulRan.

use std::{env, fs, path::Path};

use gyre_datasets::DatasetOptions;
use gyre_geometry::{OwnedScan, xy_yaw};
use gyre_matching::odometry::{Odometry, OdometryConfig};

/// The motion between the first two scans: x, y (m), yaw (rad).
fn motion(recording: &Path, hold: bool) -> [f64; 3] {
    let project = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../..");
    let text = fs::read_to_string(project.join("configs/mulran.toml")).unwrap();
    let mut table: toml::Table = toml::from_str(&text).unwrap();
    let options: DatasetOptions = table.remove("dataset").unwrap().try_into().unwrap();
    let mut config: OdometryConfig = table.try_into().unwrap();
    config.refinement.hold_standstill = hold;
    let mut dataset = gyre_datasets::open(recording, &options).unwrap();
    let mut scan = OwnedScan::with_limits(dataset.limits());
    let mut odometry = Odometry::new(&config).unwrap();
    let registered = [0, 1].map(|index| {
        scan.geometry = dataset.read(index, scan.slot()).unwrap();
        odometry.register(&scan.view(), &[]).unwrap()
    });
    xy_yaw(&registered[1].motion.motion)
}

#[test]
fn both_forms_of_mulran_stand_still() {
    let Some(data) = env::var_os("GYRE_DATA") else {
        println!("skipped: GYRE_DATA is not set");
        return;
    };
    let samples = Path::new(&data).join("samples");
    let forms = ["mulran-kaist03", "mulran-kaist03-raw"].map(|name| samples.join(name));
    let [rows, raw] = [0, 1].map(|form| motion(&forms[form], true));
    assert_eq!(rows, raw);
    let [x_m, y_m, yaw_rad] = rows;
    assert!(x_m.hypot(y_m) <= 0.02 && yaw_rad.abs().to_degrees() <= 0.03);
    // As measured, they differ by no more than their times differ.
    let [rows, raw] = [0, 1].map(|form| motion(&forms[form], false));
    let apart = [0, 1, 2].map(|k| (rows[k] - raw[k]).abs());
    assert!(apart[0] < 1e-3 && apart[1] < 1e-3 && apart[2] < 1e-4);
}
