//! `gyre-lab export-pairs` as a whole: what a training reads of a simulated drive, and what is
//! refused.

use std::{
    fs,
    path::{Path, PathBuf},
};

use gyre_datasets::{
    ground_truth::{find_ground_truth, write_tum},
    read_trajectory,
};
use gyre_geometry::Twist;
use gyre_radar::Trajectory;
use nalgebra::{Isometry2, Vector2};
use tempfile::TempDir;
use toml::Table;

use crate::{
    common::{Ended, Run, recording},
    gyre_lab,
};

const N: usize = 127;
const SMALL: &str = "[raster]\nn = 127\ncell_m = 0.8\n";
const RECORD_BYTES: usize = 2 * N * N + 7 * 8 + 3 * 4 + 4;

/// A record, read as it is documented.
struct Record {
    raster: Vec<u16>,
    searched: [f64; 3],
    pose: [f64; 3],
    time_s: f64,
    twist: [f32; 3],
    sequence: u32,
}

impl Record {
    fn of(bytes: &[u8]) -> Self {
        let (raster, rest) = bytes.split_at(2 * N * N);
        let wide: Vec<f64> = rest[..56]
            .as_chunks()
            .0
            .iter()
            .map(|b| f64::from_le_bytes(*b))
            .collect();
        let twist: Vec<f32> = rest[56..68]
            .as_chunks()
            .0
            .iter()
            .map(|b| f32::from_le_bytes(*b))
            .collect();
        Self {
            raster: raster
                .as_chunks()
                .0
                .iter()
                .map(|b| u16::from_le_bytes(*b))
                .collect(),
            searched: wide[..3].try_into().unwrap(),
            pose: wide[3..6].try_into().unwrap(),
            time_s: wide[6],
            twist: twist.try_into().unwrap(),
            sequence: u32::from_le_bytes(rest[68..].try_into().unwrap()),
        }
    }

    fn pose(&self) -> Isometry2<f64> {
        isometry(self.pose)
    }
}

fn isometry([x, y, yaw]: [f64; 3]) -> Isometry2<f64> {
    Isometry2::new(Vector2::new(x, y), yaw)
}

/// A folder with configurations, and exports into it.
struct Exports {
    folder: TempDir,
}

impl Exports {
    fn new() -> Self {
        let folder = tempfile::Builder::new()
            .prefix("gyre-export-")
            .tempdir()
            .unwrap();
        fs::write(folder.path().join("small.toml"), SMALL).unwrap();
        let simulated = format!(
            "{SMALL}[simulation]\nscans = {}\n{}",
            recording::SCANS,
            recording::SENSOR
        );
        fs::write(folder.path().join("simulated.toml"), simulated).unwrap();
        Self { folder }
    }

    fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    /// `gyre-lab export-pairs CONFIGURATION --out pairs.npy` in the folder.
    fn run(&self, configuration: &str, arguments: &[&str]) -> Ended {
        self.run_to("pairs.npy", configuration, arguments)
    }

    fn run_to(&self, out: &str, configuration: &str, arguments: &[&str]) -> Ended {
        let mut command = gyre_lab();
        command
            .current_dir(self.folder.path())
            .args(["export-pairs", configuration, "--out", out])
            .args(arguments);
        Ended::of(command)
    }

    /// The same of a recording; what it printed.
    fn of_recording(&self, data: &Path, arguments: &[&str]) -> String {
        let arguments = [&["--data", data.to_str().unwrap()], arguments].concat();
        self.run("small.toml", &arguments)
            .succeeded()
            .stdout
            .clone()
    }

    fn bytes(&self) -> Vec<u8> {
        fs::read(self.path("pairs.npy")).unwrap()
    }

    fn records(&self) -> Vec<Record> {
        let bytes = self.bytes();
        let header = 10 + usize::from(u16::from_le_bytes([bytes[8], bytes[9]]));
        let dictionary = std::str::from_utf8(&bytes[10..header]).unwrap();
        let records: Vec<Record> = bytes[header..]
            .chunks(RECORD_BYTES)
            .map(Record::of)
            .collect();
        assert!(
            dictionary.contains(&format!("'shape': ({},)", records.len())),
            "{dictionary}"
        );
        assert!(
            dictionary.contains("('raster', '<f2', (127, 127))"),
            "{dictionary}"
        );
        records
    }

    fn provenance(&self) -> Table {
        fs::read_to_string(self.path("pairs.toml"))
            .unwrap()
            .parse()
            .unwrap()
    }
}

/// The small recording's truth with the poses that `keep` keeps, as a file in `folder`.
fn truth_without(folder: &Path, keep: impl Fn(usize) -> bool) -> PathBuf {
    let truth = read_trajectory(&find_ground_truth(recording::small()).unwrap()).unwrap();
    let stamps = truth.stamp_ns.unwrap();
    let kept: Vec<usize> = (0..stamps.len()).filter(|index| keep(*index)).collect();
    let trajectory = Trajectory {
        stamp_ns: Some(kept.iter().map(|index| stamps[*index]).collect()),
        poses: kept.iter().map(|index| truth.poses[*index]).collect(),
    };
    let path = folder.join("truth.tum");
    write_tum(&trajectory, &mut fs::File::create(&path).unwrap()).unwrap();
    path
}

#[test]
fn each_scan_has_its_true_pose_and_is_found_where_it_is() {
    let exports = Exports::new();
    let printed = exports.of_recording(recording::small(), &[]);
    assert!(
        printed.starts_with("wrote 24 scans in 1 sequence to pairs.npy (0.8 MB) in "),
        "{printed}"
    );
    let truth = read_trajectory(&recording::small().join("ground_truth.tum")).unwrap();
    let records = exports.records();
    assert_eq!(records.len(), recording::SCANS);
    assert!(records[0].searched.iter().all(|value| value.is_nan()));
    for (index, record) in records.iter().enumerate() {
        let pose = truth.poses[index];
        assert_eq!(
            record.pose,
            [
                pose.translation.x,
                pose.translation.y,
                pose.rotation.angle()
            ]
        );
        assert!(
            (record.time_s * 1e9 - truth.stamp_ns.as_ref().unwrap()[index] as f64).abs() < 1_000.0
        );
        assert_eq!(record.sequence, 0);
        assert!(record.raster.iter().any(|cell| *cell != 0));
    }
    let mut errors_m = Vec::new();
    for pair in records.windows(2) {
        let error =
            isometry(pair[1].searched).inverse() * (pair[0].pose().inverse() * pair[1].pose());
        assert!(
            error.translation.vector.norm() < 1.5 && error.rotation.angle().abs() < 0.06,
            "{error}"
        );
        errors_m.push(error.translation.vector.norm());
    }
    errors_m.sort_by(f64::total_cmp);
    assert!(errors_m[errors_m.len() / 2] < 0.25, "{errors_m:?}");
}

#[test]
fn a_sweep_is_compensated_with_the_true_motion_of_the_scan_that_the_lag_names() {
    let exports = Exports::new();
    for lag in [1, 2, 3] {
        exports.of_recording(
            recording::small(),
            &["--set", &format!("masking.lag={lag}")],
        );
        let records = exports.records();
        for (index, record) in records.iter().enumerate() {
            let expected = index.checked_sub(lag + 1).map_or([0.0; 3], |from| {
                let (from, to) = (&records[from], &records[from + 1]);
                let twist = Twist::from_motion(
                    &(from.pose().inverse() * to.pose()),
                    to.time_s - from.time_s,
                );
                [
                    twist.vx_mps as f32,
                    twist.vy_mps as f32,
                    twist.yaw_rate_radps as f32,
                ]
            });
            for (actual, expected) in record.twist.iter().zip(expected) {
                assert!(
                    (actual - expected).abs() < 1e-4,
                    "scan {index}: {:?}",
                    record.twist
                );
            }
        }
    }
    exports.of_recording(recording::small(), &["--set", "masking.compensate=false"]);
    assert!(
        exports
            .records()
            .iter()
            .all(|record| record.twist == [0.0; 3])
    );
}

#[test]
fn the_search_finds_what_the_pipeline_finds() {
    let exports = Exports::new();
    exports.of_recording(recording::small(), &["--set", "masking.compensate=false"]);
    let run = Run::of_recording()
        .set("masking.compensate=false")
        .set("refinement.kind=none");
    let odometry = run.complete();
    let found = odometry.lines().skip(1).map(|row| -> [f64; 3] {
        let fields: Vec<&str> = row.split(',').collect();
        [fields[5], fields[6], fields[7]].map(|field| field.parse().unwrap())
    });
    for (found, record) in found.zip(&exports.records()[1..]) {
        let difference = isometry(found).inverse() * isometry(record.searched);
        // Rounding the rasters to f16 is all that is between the two.
        assert!(difference.translation.vector.norm() < 2e-3, "{difference}");
        assert!(difference.rotation.angle().abs() < 2e-5, "{difference}");
    }
}

#[test]
fn a_drive_gives_the_same_bytes_again_streamed_or_read() {
    let exports = Exports::new();
    exports.of_recording(recording::small(), &[]);
    let (read, made_of) = (exports.bytes(), exports.provenance());
    exports.of_recording(recording::small(), &[]);
    assert!(exports.bytes() == read && exports.provenance() == made_of);
    exports.run("simulated.toml", &[]).succeeded();
    assert!(exports.bytes() == read);
    assert_eq!(
        exports.provenance()["simulation"]["scans"].as_integer(),
        Some(recording::SCANS as i64)
    );
    exports
        .run("simulated.toml", &["--set", "simulation.seed=8"])
        .succeeded();
    assert!(exports.bytes() != read);
    assert_eq!(fs::read_dir(exports.folder.path()).unwrap().count(), 4);
}

#[test]
fn what_is_left_out_is_counted_and_ends_a_sequence() {
    let exports = Exports::new();
    let damaged = recording::copy(recording::SCANS);
    recording::truncate(&recording::images(damaged.path())[9], 1_000);
    // Known before scan 4 and after scan 19 to nobody.
    let truth = truth_without(exports.folder.path(), |index| (4..=19).contains(&index));
    let printed =
        exports.of_recording(damaged.path(), &["--ground-truth", truth.to_str().unwrap()]);
    assert!(
        printed.starts_with(
            "wrote 15 scans in 2 sequences (left out: 1 unreadable, 8 without truth) to "
        ),
        "{printed}"
    );
    let records = exports.records();
    let sequences: Vec<u32> = records.iter().map(|record| record.sequence).collect();
    assert_eq!(sequences, [[0; 5].as_slice(), &[1; 10]].concat());
    for (index, record) in records.iter().enumerate() {
        let since = if index < 5 { index } else { index - 5 };
        assert_eq!(record.searched[0].is_nan(), since == 0, "record {index}");
        assert_eq!(record.twist == [0.0; 3], since < 3, "record {index}");
    }
    let provenance = exports.provenance();
    let of = |key: &str| -> Vec<i64> {
        let sequences = provenance["sequences"].as_array().unwrap();
        sequences
            .iter()
            .map(|sequence| sequence[key].as_integer().unwrap())
            .collect()
    };
    assert_eq!(
        [of("sequence"), of("first_scan"), of("scans")],
        [[0, 1], [4, 10], [5, 10]]
    );
}

#[test]
fn a_wide_gap_in_the_truth_is_not_guessed_across() {
    let exports = Exports::new();
    // Four scans are a second: 7 to 10 are missing one by one, 14 only itself.
    let truth = truth_without(exports.folder.path(), |index| {
        !(7..=10).contains(&index) && index != 14
    });
    let printed = exports.of_recording(
        recording::small(),
        &["--ground-truth", truth.to_str().unwrap()],
    );
    assert!(
        printed.starts_with(
            "wrote 20 scans in 2 sequences (left out: 0 unreadable, 4 without truth) to "
        ),
        "{printed}"
    );
}

#[test]
fn each_recording_is_a_sequence_with_its_own_truth() {
    let exports = Exports::new();
    let part = recording::copy(6);
    let arguments = [
        "--data",
        part.path().to_str().unwrap(),
        "--set",
        "source.scans=8",
    ];
    let printed = exports.of_recording(recording::small(), &arguments);
    assert!(
        printed.starts_with("wrote 14 scans in 2 sequences to "),
        "{printed}"
    );
    let records = exports.records();
    assert_eq!((records[7].sequence, records[8].sequence), (0, 1));
    assert!(records[8].searched[0].is_nan());
    assert_eq!(records[8].raster, records[0].raster);
    let name = part.path().file_name().unwrap().to_str();
    assert_eq!(exports.provenance()["sequences"][1]["name"].as_str(), name);
}

#[test]
fn what_cannot_be_exported_is_refused_and_nothing_is_left() {
    let exports = Exports::new();
    let small = recording::small().to_str().unwrap();
    let refused = |arguments: &[&str], words: &[&str]| {
        exports.run("small.toml", arguments).refused_with(words);
        assert!(fs::read_dir(exports.folder.path()).unwrap().all(|entry| {
            let path = entry.unwrap().path();
            path.extension().unwrap() != "npy" && path.extension().unwrap() != "part"
        }));
    };
    refused(&[], &["no dataset is named"]);
    refused(
        &["--data", small, "--set", "raster.n=8"],
        &["raster", "n", "8"],
    );
    let untrue = recording::copy(3);
    fs::remove_dir_all(untrue.path().join("gt")).unwrap();
    refused(
        &["--data", small, "--data", untrue.path().to_str().unwrap()],
        &["has no ground truth", "--ground-truth"],
    );
    refused(
        &["--data", small, "--data", small, "--ground-truth", "t.tum"],
        &["t.tum", "one recording, not of 2"],
    );
    refused(
        &["--data", small, "--ground-truth", "nowhere.tum"],
        &["cannot read the trajectory nowhere.tum"],
    );
    fs::write(exports.path("times.kitti"), "1 0 0 0 0 1 0 0 0 0 1 0\n").unwrap();
    refused(
        &["--data", small, "--ground-truth", "times.kitti"],
        &["times.kitti has no times"],
    );
    let positions = "1547131046.4 1 2 0 0 0 0 1\n1547131050.4 2 3 0 0 0 0 1\n";
    fs::write(exports.path("positions.tum"), positions).unwrap();
    refused(
        &["--data", small, "--ground-truth", "positions.tum"],
        &["positions.tum has no headings"],
    );
    let elsewhen = "1447131046.4 1 2 0 0 0 0 1\n1447131050.4 2 3 0 0 0 1 1\n";
    fs::write(exports.path("elsewhen.tum"), elsewhen).unwrap();
    refused(
        &["--data", small, "--ground-truth", "elsewhen.tum"],
        &["elsewhen.tum", "no pose", "24 readable scans"],
    );
}

#[test]
fn a_configuration_is_not_overwritten() {
    let exports = Exports::new();
    exports
        .run_to("small.npy", "simulated.toml", &[])
        .refused_with(&["small.toml would be overwritten"]);
    exports
        .run_to("pairs.bin", "simulated.toml", &[])
        .refused_with(&["pairs.bin", ".npy"]);
    assert_eq!(
        fs::read_to_string(exports.path("small.toml")).unwrap(),
        SMALL
    );
}
