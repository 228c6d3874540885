//! Texts: trajectories, configurations (a recording keeps that of a simulation beside its images),
//! model cards, the results of a run.

use std::{
    fs,
    path::{Path, PathBuf},
};

use bolero::check;
use gyre_configuration::Configuration;
use gyre_datasets::{ImageSource as _, ground_truth::parse_trajectory, write_tum};
use gyre_fuzz::{
    Failure, Target,
    edit::{TextEdit, edit_text},
};
use gyre_masking::{MaskKind, MaskingConfig, model::Model};
use gyre_matching::odometry::Odometry;
use gyre_radar::RasterConfig;
use gyre_results::{judgement::judge, odometry};
use gyre_simulator::{SimulatedDrive, SimulationConfig};

use crate::recordings::folder;

/// A valid trajectory in each format.
const TRAJECTORIES: [&str; 6] = [
    // Oxford's motions between scans.
    "source_timestamp,destination_timestamp,x,y,z,roll,pitch,yaw,source_radar_timestamp,destination_radar_timestamp\n\
     1547131046603586,1547131046353776,0.5,0.01,0,0,0,0.002,1547131046480000,1547131046230000\n\
     1547131046853500,1547131046603586,0.6,0.02,0,0,0,0.003,1547131046730000,1547131046480000\n",
    // Boreas.
    "GPSTime,easting,northing,altitude,vel_east,vel_north,vel_up,roll,pitch,heading,angvel_z,angvel_y,angvel_x\n\
     1606417097528152,1.5,2.5,0,0,0,0,3.14,0.01,0.5,0,0,0\n1606417097778152,2.5,2.5,0,0,0,0,3.14,0.01,0.6,0,0,0\n",
    // MulRan.
    "1561000444390857630,1,0,0,353062.1,0,1,0,4026023.9,0,0,1,20\n1561000444640857630,1,0,0,353063.1,0,1,0,4026023.9,0,0,1,20\n",
    // TUM.
    "1549986607.003 0 0 0 0 0 0 1\n1549986607.253 1 0 0 0 0 0.1 0.995\n1549986607.503 2 0.1 0 0 0 0.2 0.98\n",
    // KITTI.
    "1 0 0 0 0 1 0 0 0 0 1 0\n1 0 0 1 0 1 0 0.1 0 0 1 0\n1 0 0 2 0 1 0 0.2 0 0 1 0\n",
    // Boreas' odometry: a time and a matrix.
    "1606417097528152 1 0 0 0 0 1 0 0 0 0 1 0\n1606417097778152 1 0 0 -1 0 1 0 0 0 0 1 0\n",
];

/// Parses a trajectory, writes it, and evaluates it against itself.
fn use_trajectory(text: &str) -> Result<(), Failure> {
    let trajectory = parse_trajectory(text, Path::new("truth.txt"))?;
    let finite = |pose: &gyre_geometry::Pose| {
        pose.translation.vector.iter().all(|x| x.is_finite()) && pose.rotation.angle().is_finite()
    };
    assert!(trajectory.poses.iter().all(finite), "{trajectory:?}");
    if trajectory.stamp_ns.is_some() {
        write_tum(&trajectory, &mut Vec::new())?;
    }
    judge(&trajectory, &trajectory)?;
    Ok(())
}

#[test]
fn trajectories() {
    let target = Target::new(16);
    check!()
        .with_type::<(u8, Vec<TextEdit>)>()
        .for_each(|(index, edits)| {
            let text = TRAJECTORIES[usize::from(*index) % TRAJECTORIES.len()];
            target.run(|| use_trajectory(&edit_text(text, edits)));
        });
}

/// The configurations that ship.
fn configurations() -> Vec<String> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../configs");
    let files = fs::read_dir(folder).unwrap();
    let files = files.map(|entry| entry.unwrap().path());
    let files = files.filter(|file| file.extension().is_some_and(|e| e == "toml"));
    let mut files: Vec<_> = files.collect();
    files.sort();
    let read = |file: &PathBuf| fs::read_to_string(file).unwrap();
    files.iter().map(read).collect()
}

/// Rasters up to this size are tried with the whole method.
const LARGEST_N: usize = 127;

#[test]
fn run_configurations() {
    let (target, texts) = (Target::new(96), configurations());
    let folder = folder();
    let file = folder.path().join("run.toml");
    check!()
        .with_type::<(u8, Vec<TextEdit>)>()
        .for_each(|(index, edits)| {
            let text = edit_text(&texts[usize::from(*index) % texts.len()], edits);
            fs::write(&file, text).unwrap();
            target.run(|| -> Result<(), Failure> {
                let configuration = Configuration::read(&file, &[])?;
                let resolved = configuration.to_toml()?;
                fs::write(&file, &resolved)?;
                let again = Configuration::read(&file, &[])?;
                assert_eq!(again.to_toml()?, resolved);
                let method = &configuration.odometry;
                if method.raster.n <= LARGEST_N && method.masking.kind != MaskKind::Learned {
                    Odometry::new(method)?;
                }
                Ok(())
            });
        });
}

#[test]
fn model_cards() {
    let target = Target::new(16);
    let folder = folder();
    let models =
        Path::new(env!("CARGO_MANIFEST_DIR")).join("../shared/method/masking/tests/models");
    let card = fs::read_to_string(models.join("single-127.toml")).unwrap();
    let (onnx, file) = ("single-127.onnx", folder.path().join("card.toml"));
    fs::copy(models.join(onnx), folder.path().join(onnx)).unwrap();
    let config = MaskingConfig {
        kind: MaskKind::Learned,
        model: Some(file.clone()),
        ..MaskingConfig::default()
    };
    let raster = RasterConfig {
        n: 127,
        cell_m: 0.8,
        ..RasterConfig::default()
    };
    check!().with_type::<Vec<TextEdit>>().for_each(|edits| {
        fs::write(&file, edit_text(&card, edits)).unwrap();
        target.run(|| -> Result<(), Failure> {
            let model = Model::read(&config, &raster)?;
            model.card.training_mismatches(&config, &raster);
            Ok(())
        });
    });
}

#[test]
fn odometry_files() {
    let target = Target::new(16);
    let (folder, row) = (folder(), |seq: i64| {
        let numbers = vec!["0.5"; 19].join(",");
        format!(
            "{seq},{seq},{},{},250000000,{numbers},refined,prediction,0.5,0.5,0,0.5,0\n",
            seq - 1,
            1_549_986_607_000_000_000 + seq
        )
    });
    let text = odometry::HEADER.to_owned() + &row(1) + &row(2) + &row(3);
    let file = folder.path().join("odometry.csv");
    fs::write(&file, &text).unwrap();
    assert_eq!(odometry::read(&file).unwrap().len(), 3);
    check!().with_type::<Vec<TextEdit>>().for_each(|edits| {
        fs::write(&file, edit_text(&text, edits)).unwrap();
        target.run(|| odometry::read(&file).map(|_| ()));
    });
}

#[test]
fn texts_without_edits_are_accepted() {
    for text in TRAJECTORIES {
        use_trajectory(text).unwrap();
    }
    assert!(configurations().len() > 5);
}

/// Images up to this size are drawn, bytes.
const LARGEST_IMAGE: usize = 1 << 20;

/// Builds the town and draws the first scan.
fn use_simulation(text: &str) -> Result<(), Failure> {
    let config: SimulationConfig =
        toml::from_str(text).map_err(|error| error.message().to_owned())?;
    let drive = SimulatedDrive::new(&config)?;
    let bytes = drive.image_size().bytes();
    assert!(drive.scans() > 0);
    if bytes <= LARGEST_IMAGE {
        drive.renderer().draw(0, &mut vec![0; bytes]);
    }
    Ok(())
}

#[test]
fn simulations() {
    let target = Target::new(512);
    let config = SimulationConfig {
        scans: Some(1),
        ..SimulationConfig::default()
    };
    let text = toml::to_string(&config).unwrap();
    use_simulation(&text).unwrap();
    check!()
        .with_type::<Vec<TextEdit>>()
        .for_each(|edits| target.run(|| use_simulation(&edit_text(&text, edits))));
}
