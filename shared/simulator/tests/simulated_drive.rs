//! Datasets of each format: written, read by the readers for real data, interrupted, resumed, and
//! streamed without a disk.

use std::{fs, path::Path};

use gyre_datasets::{DatasetOptions, Format, find_ground_truth, read_trajectory};
use gyre_geometry::{OwnedScan, Pose};
use gyre_simulator::{
    OutputFormat, SimulatedDrive, SimulationConfig, SimulatorError, Summary, output::OutputConfig,
    remove_dataset, write_dataset,
};

use crate::all_files;

const FORMATS: [OutputFormat; 3] = [
    OutputFormat::Oxford,
    OutputFormat::Boreas,
    OutputFormat::Radiate,
];

fn config(format: OutputFormat, scans: usize) -> SimulationConfig {
    SimulationConfig {
        scans: Some(scans),
        output: OutputConfig {
            format: Some(format),
        },
        ..SimulationConfig::default()
    }
}

fn write(config: &SimulationConfig, out: &Path) -> Result<Summary, SimulatorError> {
    write_dataset(config, out, &mut |_, _| {})
}

fn written(config: &SimulationConfig) -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    write(config, folder.path()).unwrap();
    folder
}

#[test]
fn each_format_is_detected_and_read_from_disk_and_memory_as_it_was_rendered() {
    for format in FORMATS {
        let config = config(format, 3);
        let (folder, drive) = (written(&config), SimulatedDrive::new(&config).unwrap());
        let options = drive.dataset_options();
        let detected = DatasetOptions {
            format: None,
            ..options
        };
        let dataset = gyre_datasets::open(folder.path(), &detected).unwrap();
        assert_eq!((dataset.format(), dataset.len()), (drive.format(), 3));
        let mut disk = gyre_datasets::open(folder.path(), &options).unwrap();
        let mut memory = gyre_datasets::open_source(Box::new(drive.renderer()), &options).unwrap();
        assert_eq!((disk.len(), disk.limits()), (memory.len(), memory.limits()));
        assert_eq!(disk.notes(), memory.notes());
        for index in [2, 0, 1] {
            let (a, b) = (disk.scan(index).unwrap(), memory.scan(index).unwrap());
            assert_eq!(a.geometry, b.geometry);
            assert!(
                a.bytes == b.bytes && a.azimuth_rad == b.azimuth_rad && a.stamp_ns == b.stamp_ns,
                "{format:?}"
            );
            let nominal_ns = disk.nominal_stamp_ns(index);
            assert_eq!(
                (nominal_ns, &a.flags),
                (memory.nominal_stamp_ns(index), &b.flags)
            );
            assert_same_measurement(&drive, &a, &drive.simulator().render_scan(index));
            let late_ns = |stamp_ns: i64| (stamp_ns - drive.stamp_ns(index)).abs();
            assert!(late_ns(a.geometry.stamp_ns) <= 1000, "{format:?}");
            assert!(late_ns(nominal_ns.unwrap()) < 1_000_000, "{format:?}");
        }
    }
}

fn assert_same_measurement(drive: &SimulatedDrive, read: &OwnedScan, rendered: &OwnedScan) {
    let (read, rendered) = (read.view(), rendered.view());
    let (a, b) = (&read.geometry, &rendered.geometry);
    assert_eq!((a.azimuths, a.bins, a.sense), (b.azimuths, b.bins, b.sense));
    assert!((a.range_resolution_m - b.range_resolution_m).abs() < 1e-6);
    // The others define another instant of the sweep as the time of the scan.
    let has_same_time = drive.format() == Format::Oxford;
    assert!(!has_same_time || a.stamp_ns / 1000 == b.stamp_ns / 1000);
    let without_encoder = drive.format() == Format::Radiate;
    // Without an encoder the first azimuth counts as straight ahead.
    let first_rad = if without_encoder {
        rendered.azimuth_rad[0]
    } else {
        0.0
    };
    for azimuth in 0..a.azimuths {
        assert_eq!(read.row(azimuth), rendered.row(azimuth));
        assert!(
            (read.azimuth_rad[azimuth] + first_rad - rendered.azimuth_rad[azimuth]).abs() < 1e-5
        );
        assert!((read.stamp_ns[azimuth] - rendered.stamp_ns[azimuth]).abs() < 2_000);
        // Only Oxford's format marks interpolated azimuths.
        let has_flags = drive.format() == Format::Oxford;
        assert!(!has_flags || read.flags[azimuth] == rendered.flags[azimuth]);
    }
}

#[test]
fn each_format_gives_the_poses_of_the_sensor() {
    for format in FORMATS {
        let config = config(format, 8);
        let (folder, drive) = (written(&config), SimulatedDrive::new(&config).unwrap());
        assert_eq!(
            find_ground_truth(folder.path()),
            Some(folder.path().join("ground_truth.tum"))
        );
        let own = match format {
            OutputFormat::Oxford => Some("gt/radar_odometry.csv"),
            OutputFormat::Boreas => Some("applanix/radar_poses.csv"),
            OutputFormat::Radiate => None,
        };
        for file in own.into_iter().chain(["ground_truth.tum"]) {
            let truth = read_trajectory(&folder.path().join(file)).unwrap();
            let stamps = truth.stamp_ns.unwrap();
            assert_eq!(stamps.len(), 8);
            let start = truth.poses[0];
            for (index, pose) in truth.poses.iter().enumerate() {
                assert!(
                    (stamps[index] - drive.stamp_ns(index)).abs() <= 1000,
                    "{file}: scan {index}"
                );
                let expected =
                    pose_at(&drive, stamps[0]).inverse() * pose_at(&drive, stamps[index]);
                let error = (start.inverse() * pose).inverse() * expected;
                assert!(error.translation.vector.norm() < 1e-5, "{file}: {error}");
                assert!(error.rotation.angle().abs() < 1e-7, "{file}: {error}");
            }
        }
    }
}

fn pose_at(drive: &SimulatedDrive, stamp_ns: i64) -> Pose {
    let epoch_ns = drive.simulator().time(0).epoch_us * 1000;
    drive
        .simulator()
        .path()
        .pose((stamp_ns - epoch_ns) as f64 * 1e-9)
}

#[test]
fn an_interrupted_dataset_is_completed_and_extended_by_more_scans() {
    for format in FORMATS {
        let (cut, config) = (written(&config(format, 5)), config(format, 6));
        let drive = SimulatedDrive::new(&config).unwrap();
        let image = |index: usize| {
            let folder = cut.path().join(drive.image_folder());
            folder.join(drive.image_name(index))
        };
        // One image is missing, one is incomplete, the others are complete.
        fs::remove_file(image(2)).unwrap();
        let draft = format!(".{}.tmp", drive.image_name(4));
        fs::rename(image(4), image(4).with_file_name(draft)).unwrap();
        fs::remove_file(cut.path().join("ground_truth.tum")).unwrap();
        let modified = || fs::metadata(image(1)).unwrap().modified().unwrap();
        let (untouched, mut seen) = (modified(), Vec::new());
        let mut see = |done: usize, total: usize| seen.push((done, total));
        let summary = write_dataset(&config, cut.path(), &mut see).unwrap();
        assert_eq!((summary.scans, summary.kept), (6, 3));
        assert!((summary.duration_s - 1.25).abs() < 1e-9 && summary.path_m > 2.0);
        assert_eq!(seen, [(3, 6), (4, 6), (5, 6), (6, 6)]);
        assert_eq!(modified(), untouched);
        let whole = written(&config);
        assert!(
            all_files(cut.path()) == all_files(whole.path()),
            "{format:?}"
        );
    }
}

#[test]
fn a_folder_of_another_origin_is_rejected_and_not_changed() {
    let original = config(OutputFormat::Oxford, 3);
    let folder = written(&original);
    let rejected = |config: &SimulationConfig, folder: &Path, words: &str| {
        let before = all_files(folder);
        let error = write(config, folder);
        let is_named =
            matches!(&error, Err(SimulatorError::OtherFiles(text)) if text.contains(words));
        assert!(is_named, "{words}: {error:?}");
        assert!(all_files(folder) == before);
    };
    let other_seed = SimulationConfig {
        seed: 9,
        ..original.clone()
    };
    rejected(&other_seed, folder.path(), "another configuration");
    let fewer = config(OutputFormat::Oxford, 2);
    rejected(&fewer, folder.path(), "no file of this dataset");
    let unnamed = tempfile::tempdir().unwrap();
    let name = SimulatedDrive::new(&original).unwrap().image_name(0);
    fs::create_dir(unnamed.path().join("radar")).unwrap();
    fs::write(unnamed.path().join("radar").join(&name), "someone's").unwrap();
    rejected(&original, unnamed.path(), "no file of this dataset");
    // An image that is rendered differently now.
    let first = folder.path().join("radar").join(&name);
    let mut bytes = fs::read(&first).unwrap();
    *bytes.last_mut().unwrap() ^= 1;
    fs::write(&first, bytes).unwrap();
    rejected(&original, folder.path(), "differs from the image");
}

#[test]
fn a_dataset_is_removed_unless_the_folder_has_files_of_others() {
    let folder = written(&config(OutputFormat::Oxford, 3));
    let notes = folder.path().join("radar/notes.txt");
    fs::write(&notes, "rain").unwrap();
    let before = all_files(folder.path());
    let refused = remove_dataset(folder.path()).unwrap_err().to_string();
    assert!(refused.contains("notes.txt"), "{refused}");
    assert!(all_files(folder.path()) == before);
    fs::remove_file(&notes).unwrap();
    remove_dataset(folder.path()).unwrap();
    assert!(all_files(folder.path()).is_empty());
}
