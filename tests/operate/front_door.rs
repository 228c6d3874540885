//! The first steps: the demo and the configurations of the program in any folder, and one page
//! about the results.

use std::{fs, path::Path};

use crate::common::{Ended, gyre, recording};

/// A command in a folder that has nothing of the project.
fn at(folder: &Path, arguments: &[&str]) -> Ended {
    let mut command = gyre();
    command.current_dir(folder).args(arguments);
    Ended::of(command)
}

#[test]
fn the_demo_works_in_an_empty_folder_and_its_configuration_repeats_it() {
    let folder = tempfile::tempdir().unwrap();
    let text = |name: &str| fs::read_to_string(folder.path().join(name)).unwrap();
    let few = ["--set=simulation.scans=8", "--set=masking.backend=rten"];
    at(folder.path(), &[&["demo"], &few[..]].concat()).succeeded();
    let configuration = text("out/demo/config.toml");
    let model = "model = \"gyre:models/gyre-255.toml\"";
    assert!(configuration.contains(model), "{configuration}");
    let resolved = "out/demo/config.toml";
    at(folder.path(), &["run", resolved, "--out", "again"]).succeeded();
    assert_eq!(text("again/odometry.csv"), text("out/demo/odometry.csv"));

    let ended = at(folder.path(), &["report", "out/demo", "again"]);
    assert_eq!(ended.succeeded().stdout, "out/demo/comparison.html\n");
    let page = text("out/demo/comparison.html");
    assert!(page.contains("All keys are equal."), "{page}");
    let maps = page.matches("data:image/png;base64,");
    assert_eq!(maps.count(), 2);
}

#[test]
fn a_configuration_of_the_program_is_run_by_its_name_on_a_recording() {
    let folder = tempfile::tempdir().unwrap();
    let data = recording::small();
    let data = data.to_str().unwrap();
    let run = ["run", data, "stop-and-go", "--json"];
    let ended = at(folder.path(), &run);
    let summary: serde_json::Value = serde_json::from_str(&ended.succeeded().stdout).unwrap();
    assert_eq!(summary["processed"], recording::SCANS);
    let odometry = folder.path().join("out/stop-and-go/odometry.csv");
    assert!(odometry.is_file());
    at(folder.path(), &["run", "oxfrod"])
        .refused_with(&["`oxfrod` is no file or folder", "did you mean `oxford`?"]);
    at(folder.path(), &["evaluate", "out/stop-and-go", data]).succeeded();
}
