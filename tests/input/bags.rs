//! Bags of ROS 2: a run's results are written and then read by an independent reader, and its scans
//! give the same motions again.

use std::{
    fs,
    path::{Path, PathBuf},
};

use serde_json::Value;

use crate::{
    common::{Ended, Run, finished, odometry, recording, recording::with_constants, script},
    live::radar::whole,
    reach::python_has,
};

fn export(source: &Path, bag: &Path, arguments: &[&str]) -> Ended {
    finished!["export", source, "--mcap", bag; arguments]
}

/// A run of a bag, with the resolved configuration of another run and the constants of the radar,
/// which a bag does not have.
fn replayed(of: &Run, bag: &Path) -> Run {
    let run = Run::of_file(&of.out().join("config.toml")).data(bag);
    with_constants(run).set("record.file=''")
}

fn bag(run: &Run, name: &str) -> PathBuf {
    run.folder().join(name)
}

/// Returns the independent reader's report about the bag of a run, and about a bag with a radar
/// that looks to the left; `None` where it is not installed.
fn checked(bag: &Path, out: &Path, turned: Option<&Path>) -> Option<Value> {
    if !python_has("rosbags, numpy") {
        return None;
    }
    let mut command = script("input/bags/check.py");
    command.arg(bag).arg(out).args(turned);
    let ended = Ended::of(command);
    ended.succeeded();
    Some(serde_json::from_str(&ended.stdout).unwrap())
}

#[test]
fn a_run_exported_in_any_form_is_taken_back_to_the_same_motions() {
    let whole = whole(recording::SCANS);
    let run = Run::small().data(whole.path());
    let motions = run.complete();
    for (name, form) in [("turns", "b-scan"), ("azimuths.mcap", "fft")] {
        let bag = bag(&run, name);
        export(run.out(), &bag, &["--scans", form]).succeeded();
        assert_eq!(replayed(&run, &bag).complete(), motions, "{form}");
    }
}

#[test]
fn odometry_transforms_and_the_map_are_those_of_the_run_to_another_reader() {
    let whole = whole(recording::SCANS);
    let run = Run::small().data(whole.path()).set("slam.kind=graph");
    // Some motions are predicted.
    let run = run.sets("refinement.min_overlap=0.98 refinement.firm_overlap=0.98");
    run.finish()
        .failed_with(&["hardly measured this trajectory"]);
    let motions = odometry::rows(&run.odometry()).len();
    let path = bag(&run, "bag");
    export(run.out(), &path, &[]).succeeded();
    assert!(path.join("metadata.yaml").is_file());
    let turned = bag(&run, "turned");
    export(run.out(), &turned, &["--mounting", "0,0,90"]).succeeded();
    let Some(figures) = checked(&path, run.out(), Some(&turned)) else {
        return;
    };
    assert_eq!(figures["odometry"], motions + 1);
    assert_ne!(figures["predicted"], 0);
    assert_eq!(figures["b_scans"], recording::SCANS);
    let topics = figures["topics"].to_string();
    for topic in [
        "/map",
        "/tf",
        "/tf_static",
        "/radar_data/configuration_data",
    ] {
        assert!(topics.contains(&format!("{topic:?}")), "{topics}");
    }
}

#[test]
fn the_objects_of_a_run_and_of_its_recording_are_those_of_the_results_to_another_reader() {
    let run = Run::small().data(recording::around_a_block());
    let recorded = bag(&run, "drive.mcap");
    let run = run.argument("--record", recorded.to_str().unwrap());
    let run = run.sets("run.window=32 objects.kind=tracks").rate("20");
    run.complete();
    for (source, name) in [(run.out(), "of_run"), (&recorded, "of_recording.mcap")] {
        let path = bag(&run, name);
        export(source, &path, &["--scans", "none"]).succeeded();
        let Some(figures) = checked(&path, run.out(), None) else {
            return;
        };
        assert!(figures["objects"].as_u64() > Some(20), "{figures}");
    }
}

#[test]
fn a_dataset_becomes_a_bag_of_its_scans() {
    let whole = whole(recording::SCANS);
    let run = Run::small().data(whole.path());
    let path = bag(&run, "scans.mcap");
    let exported = export(whole.path(), &path, &["--scans", "b-scan,fft"]);
    exported.succeeded().prints("/radar_data/fft_data 9600");
    let words = [
        "scans on several topics",
        "--set dataset.topic=/radar_data/",
    ];
    Run::small().data(&path).finish().refused_with(&words);
    let motions = run.complete();
    let again = replayed(&run, &path).set("dataset.topic='/radar_data/fft_data'");
    assert_eq!(again.complete(), motions);
    finished!["inspect", &path].refused_with(&["scans on several topics"]);
    let chosen = ["--set", "dataset.topic=/radar_data/fft_data"];
    finished!["inspect", &path; chosen].succeeded();
}

#[test]
fn a_bag_without_its_end_gives_results_but_no_success() {
    let run = Run::of_recording();
    run.complete();
    let path = bag(&run, "bag.mcap");
    let exported = export(run.out(), &path, &[]);
    // A few rows of the recording are not measured, as in real ones.
    exported.succeeded().says("interpolated rows: ");
    let bytes = fs::read(&path).unwrap();
    // Zstandard's signature begins the content of each chunk.
    let magic = [0x28, 0xb5, 0x2f, 0xfd];
    let chunks = (0..bytes.len() - 4).filter(|at| bytes[*at..*at + 4] == magic);
    let chunks: Vec<usize> = chunks.collect();
    // Cut within a chunk: the messages before the cut are read.
    fs::write(&path, &bytes[..chunks[chunks.len() / 2] + 1000]).unwrap();
    let again = Run::of_file(&run.out().join("config.toml")).data(&path);
    again.finish().failed_with(&["has no end behind byte"]);
    let motions = odometry::rows(&again.odometry()).len();
    assert!((1..recording::SCANS - 1).contains(&motions), "{motions}");
    let inspected = finished!["inspect", &path].succeeded().stdout.clone();
    assert!(inspected.contains("has no end"), "{inspected}");
}

#[test]
fn an_export_without_a_source_is_refused() {
    let nothing = tempfile::tempdir().unwrap();
    let bag = nothing.path().with_extension("mcap");
    export(nothing.path(), &bag, &[]).failed_with(&["no PNG images"]);
    assert!(!bag.exists());
}
