//! Datasets of each format: written, read by the readers for real data, interrupted, resumed, and
//! streamed without a disk.

use std::{collections::BTreeMap, fs, num::NonZeroUsize, path::Path};

use gyre_datasets::{Dataset, DatasetOptions, Format, find_ground_truth, inspect, read_trajectory};
use gyre_geometry::{Pose, OwnedScan};
use gyre_worlds::{output::OutputConfig, HostStamps, OutputFormat, SimulatedDrive, SimulationConfig, SimulatorError, Summary, write_dataset, write_dataset_on};

use crate::common::all_files;

const FORMATS: [OutputFormat; 3] = [
    OutputFormat::Oxford,
    OutputFormat::Boreas,
    OutputFormat::Radiate,
];

fn config(format: OutputFormat, scans: usize) -> SimulationConfig {
    let output = OutputConfig {
        format: Some(format),
        ..OutputConfig::default()
    };
    SimulationConfig {
        scans: Some(scans),
        output,
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

/// The options of the radar without the format, which is to be detected.
fn options(drive: &SimulatedDrive) -> DatasetOptions {
    DatasetOptions {
        format: None,
        ..drive.dataset_options()
    }
}

fn read(dataset: &mut dyn Dataset, index: usize) -> OwnedScan {
    let mut scan = OwnedScan::with_limits(dataset.limits());
    scan.geometry = dataset.read(index, scan.slot()).unwrap();
    scan
}

#[test]
fn each_format_is_detected_and_read_back_as_it_was_rendered() {
    for format in FORMATS {
        let config = config(format, 3);
        let (folder, drive) = (written(&config), SimulatedDrive::new(&config).unwrap());
        let mut dataset = gyre_datasets::open(folder.path(), &options(&drive)).unwrap();
        assert_eq!((dataset.format(), dataset.len()), (drive.format(), 3));
        for index in 0..3 {
            let (read, rendered) = (
                read(dataset.as_mut(), index),
                drive.simulator().render_scan(index).scan,
            );
            assert_same_measurement(&drive, &read, &rendered);
            if format == OutputFormat::Oxford {
                let of = |scan: &OwnedScan| {
                    let geometry = scan.geometry;
                    (geometry.stamp_ns / 1000, geometry.range_resolution_m)
                };
                assert_eq!(of(&read), of(&rendered));
            }
            assert!(
                (read.geometry.stamp_ns - drive.stamp_ns(index)).abs() <= 1000,
                "{format:?}"
            );
            let nominal_ns = dataset.nominal_stamp_ns(index).unwrap();
            assert!(
                (nominal_ns - drive.stamp_ns(index)).abs() < 1_000_000,
                "{format:?}: {nominal_ns}"
            );
        }
    }
}

fn assert_same_measurement(drive: &SimulatedDrive, read: &OwnedScan, rendered: &OwnedScan) {
    let (read, rendered) = (read.view(), rendered.view());
    let (a, b) = (&read.geometry, &rendered.geometry);
    assert_eq!((a.azimuths, a.bins, a.sense), (b.azimuths, b.bins, b.sense));
    assert!((a.range_resolution_m - b.range_resolution_m).abs() < 1e-6);
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
fn inspection_finds_nothing_odd_in_any_format() {
    for format in FORMATS {
        let config = config(format, 4);
        let (folder, drive) = (written(&config), SimulatedDrive::new(&config).unwrap());
        let report = inspect(folder.path(), &options(&drive))
            .unwrap()
            .to_string();
        assert!(report.contains(drive.format().name()), "{report}");
        assert!(report.contains("ground_truth.tum"), "{report}");
    }
}

#[test]
fn a_stalling_host_shifts_the_logged_times_and_not_the_sensors_clock() {
    let mut config = config(OutputFormat::Radiate, 40);
    config.output.host_stamps = HostStamps::Stalling;
    let drive = SimulatedDrive::new(&config).unwrap();
    let source = Box::new(drive.renderer());
    let dataset = gyre_datasets::open_source(source, &drive.dataset_options()).unwrap();
    let late_ns = |index: usize| {
        dataset.logged_stamp_ns(index).unwrap() - dataset.nominal_stamp_ns(index).unwrap()
    };
    assert!((0..40).map(late_ns).max().unwrap() > 150_000_000);
    for index in 0..40 {
        let error_ns = dataset.nominal_stamp_ns(index).unwrap() - drive.stamp_ns(index);
        assert!(error_ns.abs() < 1_000_000, "scan {index}: {error_ns} ns");
    }
}

#[test]
fn azimuth_poses_are_an_array_that_numpy_reads() {
    let config = config(OutputFormat::Oxford, 2);
    let (folder, drive) = (written(&config), SimulatedDrive::new(&config).unwrap());
    let bytes = fs::read(folder.path().join("azimuth_poses.npy")).unwrap();
    assert_eq!(&bytes[..8], b"\x93NUMPY\x01\x00");
    let header = 10 + usize::from(u16::from_le_bytes([bytes[8], bytes[9]]));
    assert_eq!(header % 64, 0);
    let dictionary = String::from_utf8(bytes[10..header].to_vec()).unwrap();
    assert!(
        dictionary.contains("'shape': (2, 400, 4)") && dictionary.ends_with('\n'),
        "{dictionary}"
    );
    let values: Vec<f64> = bytes[header..]
        .chunks_exact(8)
        .map(|value| f64::from_le_bytes(value.try_into().unwrap()))
        .collect();
    assert_eq!(values.len(), 2 * 400 * 4);
    for (scan, azimuth) in [(0, 0), (0, 399), (1, 17)] {
        let simulator = drive.simulator();
        let time = simulator.time(scan);
        let time_s = time.drive_time_s(time.stamp_us(azimuth));
        let pose = simulator.path().pose(time_s);
        let expected = [
            time_s,
            pose.translation.x,
            pose.translation.y,
            pose.rotation.angle(),
        ];
        assert_eq!(values[(scan * 400 + azimuth) * 4..][..4], expected);
    }
}

#[test]
fn the_number_of_threads_does_not_change_a_byte() {
    let config = config(OutputFormat::Oxford, 7);
    let on = |threads| {
        let folder = tempfile::tempdir().unwrap();
        write_dataset_on(
            NonZeroUsize::new(threads).unwrap(),
            &config,
            folder.path(),
            &mut |_, _| {},
        )
        .unwrap();
        all_files(folder.path())
    };
    let alone = on(1);
    assert!(alone == on(2) && alone == on(5));
}

#[test]
fn an_interrupted_dataset_is_completed() {
    let config = config(OutputFormat::Boreas, 6);
    let whole = written(&config);
    let cut = written(&config);
    let images = fs::read_dir(cut.path().join("radar"))
        .unwrap()
        .map(|entry| entry.unwrap().path());
    let images: BTreeMap<_, _> = images.map(|path| (path.clone(), path)).collect();
    let images: Vec<_> = images.into_values().collect();
    // One image is missing, one is incomplete, the others are complete.
    fs::remove_file(&images[2]).unwrap();
    let name = images[4].file_name().unwrap().to_str().unwrap();
    fs::rename(&images[4], images[4].with_file_name(format!(".{name}.tmp"))).unwrap();
    fs::remove_file(cut.path().join("ground_truth.tum")).unwrap();
    let untouched = fs::metadata(&images[1]).unwrap().modified().unwrap();
    let mut seen = Vec::new();
    let summary = write_dataset(&config, cut.path(), &mut |done, total| {
        seen.push((done, total))
    })
    .unwrap();
    assert_eq!((summary.scans, summary.kept), (6, 4));
    assert_eq!(seen, [(4, 6), (5, 6), (6, 6)]);
    assert_eq!(
        fs::metadata(&images[1]).unwrap().modified().unwrap(),
        untouched
    );
    assert!(all_files(cut.path()) == all_files(whole.path()));
}

#[test]
fn a_dataset_is_extended_by_more_scans() {
    for format in FORMATS {
        let folder = written(&config(format, 3));
        let summary = write(&config(format, 5), folder.path()).unwrap();
        assert_eq!((summary.scans, summary.kept), (5, 3));
        assert!(
            all_files(folder.path()) == all_files(written(&config(format, 5)).path()),
            "{format:?}"
        );
    }
}

#[test]
fn a_folder_of_another_origin_is_rejected_and_not_changed() {
    let original = config(OutputFormat::Oxford, 3);
    let folder = written(&original);
    let before = all_files(folder.path());
    let other_seed = SimulationConfig {
        seed: 9,
        ..original.clone()
    };
    assert!(matches!(
        write(&other_seed, folder.path()),
        Err(SimulatorError::OtherDataset { .. })
    ));
    let fewer = SimulationConfig {
        scans: Some(2),
        ..original.clone()
    };
    assert!(matches!(
        write(&fewer, folder.path()),
        Err(SimulatorError::OutputInUse { .. })
    ));
    assert!(all_files(folder.path()) == before);
    let unnamed = tempfile::tempdir().unwrap();
    fs::create_dir(unnamed.path().join("radar")).unwrap();
    fs::write(
        unnamed.path().join("radar/1547132400000000.png"),
        "someone's",
    )
    .unwrap();
    assert!(matches!(
        write(&original, unnamed.path()),
        Err(SimulatorError::OutputInUse { .. })
    ));
}

#[test]
fn an_image_that_would_be_rendered_differently_is_reported() {
    let config = config(OutputFormat::Oxford, 3);
    let folder = written(&config);
    let first = folder
        .path()
        .join("radar")
        .join(SimulatedDrive::new(&config).unwrap().image_name(0));
    let mut bytes = fs::read(&first).unwrap();
    *bytes.last_mut().unwrap() ^= 1;
    fs::write(&first, bytes).unwrap();
    let error = write(&config, folder.path());
    assert!(
        matches!(&error, Err(SimulatorError::OtherImage { path }) if *path == first),
        "{error:?}"
    );
}

#[test]
fn streamed_scans_equal_those_from_a_disk() {
    for format in FORMATS {
        let config = config(format, 3);
        let (folder, drive) = (written(&config), SimulatedDrive::new(&config).unwrap());
        let options = drive.dataset_options();
        let mut disk = gyre_datasets::open(folder.path(), &options).unwrap();
        let mut memory = gyre_datasets::open_source(Box::new(drive.renderer()), &options).unwrap();
        assert_eq!((disk.len(), disk.limits()), (memory.len(), memory.limits()));
        assert_eq!(disk.notes(), memory.notes());
        for index in [2, 0, 1] {
            let (a, b) = (read(disk.as_mut(), index), read(memory.as_mut(), index));
            assert_eq!(a.geometry, b.geometry);
            assert!(
                a.bytes == b.bytes && a.azimuth_rad == b.azimuth_rad && a.stamp_ns == b.stamp_ns,
                "{format:?}"
            );
            assert_eq!(
                (disk.nominal_stamp_ns(index), a.flags),
                (memory.nominal_stamp_ns(index), b.flags)
            );
        }
    }
}
