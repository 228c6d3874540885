//! Stages that are functions of Python: five lines in a file, in the Python that `GYRE_PYTHON`
//! names, else `python3`, which needs numpy.

use std::{
    fs,
    path::{Path, PathBuf},
    process::Command,
};

use rustix::process::Signal;
use tempfile::TempDir;

use crate::{
    common::{
        Ended, Run, finished, folder, gyre,
        leftovers::root,
        odometry::columns,
        processes::{child_with, of_run},
        send, undisturbed,
    },
    operate::commands::ask,
    reach::{assert_near, only_if, python_has, swap_masking},
};

/// A file with a function.
fn file(text: &str) -> (TempDir, PathBuf) {
    let folder = folder();
    let file = folder.path().join("mine.py");
    fs::write(&file, text).unwrap();
    (folder, file)
}

fn with(run: Run, stage: &str, file: &Path) -> Run {
    run.set(&format!("stages.{stage}.python='{}'", file.display()))
}

/// A run that ends at the first failure of the function.
fn failing(stage: &str, file: &Path) -> Run {
    let run = with(Run::of_recording(), stage, file);
    run.set(&format!("stages.{stage}.restart.limit=0"))
}

#[test]
fn factors_of_powers_are_a_threshold_where_they_are_one() {
    only_if!(python_has("numpy"));
    let threshold = Run::of_recording().set("masking.threshold=90").complete();
    assert_ne!(threshold, undisturbed());
    // Powers above 90 stay unchanged, and all others are below the threshold of 60.
    let text = "def mask(scan):\n    return scan.power > 90\n";
    let (_folder, file) = file(text);
    let run = with(Run::of_recording(), "masking", &file);
    let masked = run.complete();
    assert_ne!(masked, undisturbed());
    // Powers count from the threshold on, so the rasters differ, but not by where things are.
    assert_near(&threshold, &masked, 0.1);
}

#[test]
fn a_mask_sees_the_scan_and_its_place() {
    only_if!(python_has("numpy"));
    let (folder, file) = file(
        "import json, pathlib, numpy as np\n\
         def mask(scan):\n\
         \x20   print('masks', scan.stamp_ns)\n\
         \x20   seen = dict(power=scan.power.shape, raster=scan.raster.shape, bearings=scan.azimuth_rad.shape,\n\
         \x20       sum=int(scan.power.astype(int).sum()), writes=bool(scan.power.flags.writeable),\n\
         \x20       cell_m=scan.cell_m, bin_m=scan.range_resolution_m)\n\
         \x20   pathlib.Path(__file__).with_name('seen.json').write_text(json.dumps(seen))\n\
         \x20   return np.ones(scan.raster.shape)\n",
    );
    with(Run::of_recording(), "masking", &file).complete();
    let seen = fs::read_to_string(folder.path().join("seen.json")).unwrap();
    let seen: serde_json::Value = serde_json::from_str(&seen).unwrap();
    let [azimuths, bins] = [0, 1].map(|axis| seen["power"][axis].as_u64().unwrap());
    assert_eq!(seen["bearings"][0], azimuths);
    assert_eq!(seen["raster"][0], seen["raster"][1]);
    assert!(azimuths >= 100 && bins >= 100, "{seen}");
    assert!(seen["sum"].as_u64().unwrap() > azimuths, "{seen}");
    assert_eq!(seen["writes"], false);
    assert!(seen["cell_m"].as_f64().unwrap() > 0.0 && seen["bin_m"].as_f64().unwrap() > 0.0);
}

#[test]
fn searches_return_the_motion_of_the_run() {
    only_if!(python_has("numpy"));
    let (_folder, file) = file(
        "def rotation(scan, previous):\n\
         \x20   assert scan.stamp_ns > previous.stamp_ns and scan.raster.shape == previous.raster.shape\n\
         \x20   return 0.01, 0.002\n\
         def translation(scan, previous, rotation_rad):\n\
         \x20   return 1.5, 10.0 * rotation_rad, [[0.04, 0.01], [0.01, 0.09]]\n",
    );
    let run = with(Run::of_recording(), "rotation-search", &file);
    let run = with(run, "translation-search", &file).set("refinement.kind=none");
    let names = [
        "x_m",
        "y_m",
        "yaw_rad",
        "cov_xx",
        "cov_xy",
        "cov_yy",
        "cov_yawyaw",
    ];
    let odometry = run.complete();
    let rows = columns(&odometry, &names);
    assert!(rows.len() > 10);
    for row in &rows[1..] {
        let found: Vec<f64> = row.iter().map(|text| text.parse().unwrap()).collect();
        for (found, expected) in found.iter().zip([1.5, 0.1, 0.01, 0.04, 0.01, 0.09, 4e-6]) {
            assert!((found - expected).abs() < 1e-6, "{row:?}");
        }
    }
}

/// A mask that fails in its third line at the fifth scan.
fn failing_mask() -> (TempDir, PathBuf) {
    file(
        "seen = 0\n\
         def helper():\n\
         \x20   return {}['wall']\n\
         def mask(scan):\n\
         \x20   global seen\n\
         \x20   seen += 1\n\
         \x20   if seen > 4: helper()\n\
         \x20   return scan.power > 0\n",
    )
}

#[test]
fn an_exception_ends_the_run_with_its_line_and_leaves_its_traceback() {
    only_if!(python_has("numpy"));
    let (_folder, file) = failing_mask();
    let run = failing("masking", &file);
    let place = format!("{}, line 3: KeyError: 'wall'", file.display());
    run.finish().failed_with(&["masking", &place]);
    let logs = ask(&run, &["logs", "masking"]);
    logs.prints("Traceback").prints("in helper");
}

#[test]
fn what_cannot_be_loaded_or_returned_is_said() {
    only_if!(python_has("numpy"));
    for row in [
        "masking | def mask(scan) | line 1: SyntaxError",
        "masking | masks = 1 | there is no function `mask`",
        "masking | mask = lambda s: s.power[:, :3] | shape",
        "masking | mask = lambda s: s.raster + 2.0 | not all from 0 to 1",
        "masking | mask = lambda s: 1j * s.raster | complex",
        "masking | from numpy.ma import *\nmask = lambda s: masked_all(9) | masked",
        "masking | import os\nmask = lambda s: os._exit(3) | Python has ended",
        "rotation-search | rotation = lambda *s: (7.0, 0.1) | at most half a turn",
        "rotation-search | rotation = lambda *s: 0.1 | TypeError",
        "rotation-search | rotation = lambda *s: (float('nan'), 0) | not finite",
        "translation-search | translation = lambda *s: (1, 0, -0.1) | neither a standard deviation",
        "translation-search | translation = lambda *s: (1, 0, [[1, 5], [0, 1]]) | nor a covariance",
    ] {
        let row: Vec<&str> = row.split(" | ").collect();
        let [stage, text, sentence] = row[..] else {
            panic!("{row:?}");
        };
        let (_folder, file) = file(text);
        let run = failing(stage, &file);
        run.finish().failed_with(&["mine.py", sentence]);
    }
    let run = with(Run::of_recording(), "masking", Path::new("no_such.py"));
    run.finish().failed_with(&["no_such.py"]);
    let (_folder, file) = file("def mask(scan):\n    return 1\n");
    with(Run::of_recording(), "refinement", &file)
        .finish()
        .refused_with(&[
            "stages.refinement",
            "masking, rotation-search, translation-search",
        ]);
    let run = with(Run::of_recording(), "rotation-search", &file).set("search.kind=exhaustive");
    run.finish()
        .refused_with(&["stages.rotation-search", "no such stage"]);
    let run = with(Run::of_recording(), "masking", &file).set("stages.masking.command=['x']");
    run.finish()
        .refused_with(&["stages.masking", "remove one of them"]);
}

#[test]
fn an_interpreter_that_is_none_is_tried_once() {
    let (_folder, file) = file("def mask(scan):\n    return scan.power > 0\n");
    for (python, sentence) in [
        ("/bin/false", "/bin/false has ended before it had loaded"),
        ("/no/such/python", "cannot start /no/such/python for"),
    ] {
        let run = with(Run::of_recording(), "masking", &file);
        let mut command = run.command();
        command.env("GYRE_PYTHON", python);
        let ended = run.start_as(command).finish();
        ended.failed_with(&[sentence, "GYRE_PYTHON"]);
        assert_eq!(ended.stderr.matches("masking died").count(), 1);
    }
}

#[test]
fn killed_it_leaves_no_interpreter_and_no_other_byte() {
    only_if!(python_has("numpy"));
    let (_folder, file) = file("def mask(scan):\n    return scan.raster >= 0\n");
    let run = with(Run::of_recording(), "masking", &file).rate("6");
    let mut running = run.start();
    for pose in [6, 12] {
        running.await_poses(pose);
        let word = file.to_str().unwrap();
        let stage = child_with(running.pid(), word).unwrap();
        let interpreter = child_with(stage, word).unwrap();
        // Either may die.
        send(if pose == 6 { stage } else { interpreter }, Signal::KILL);
    }
    assert_eq!(running.complete(), undisturbed());
    assert!(of_run(&root(run.out())).is_empty());
}

#[test]
fn one_that_changes_neither_goes_on_nor_passes_for_the_one_before() {
    only_if!(python_has("numpy"));
    let above = |power: u8| format!("def mask(scan):\n    return scan.power > {power}\n");
    let (text, other) = (above(0), above(100));
    let (_folder, file) = file(&text);
    let run = with(Run::of_recording(), "masking", &file).rate("6");
    let running = run.started(6);
    fs::write(&file, &other).unwrap();
    let stage = child_with(running.pid(), file.to_str().unwrap());
    send(stage.unwrap(), Signal::KILL);
    let changed = "mine.py has changed since";
    let ended = running.finish();
    ended.failed_with(&["masking has ended", changed]);
    let is_another = "the program of masking is another one";
    run.finish()
        .refused_with(&["unfinished run of another program", is_another]);
    fs::write(&file, &text).unwrap();
    assert_eq!(run.complete(), undisturbed());
    // A changed file does not continue the results of the old file.
    fs::write(&file, &other).unwrap();
    run.finish().refused_with(&[is_another]);
}

/// Begins a stage in a folder, and returns its project.
fn begun(folder: &TempDir, stage: &str, options: &[&str]) -> PathBuf {
    let mut new = gyre();
    new.current_dir(folder).args(["new", "stage", stage]);
    new.args(options);
    Ended::of(new).succeeded();
    folder.path().join(format!("my-{stage}"))
}

#[test]
#[ignore = ".ci/nightly: begins stages and holds them to their contracts"]
fn begun_stages_keep_the_contract_and_drive() {
    only_if!(python_has("numpy"));
    for (stage, function) in [
        ("masking", "mask"),
        ("rotation-search", "rotation"),
        ("translation-search", "translation"),
    ] {
        let folder = folder();
        let project = begun(&folder, stage, &["--python"]);
        let file = project.join(format!("{function}.py"));
        finished!["conformance", stage, "--scans", "12", "--python", &file].succeeded();
        let odometry = with(Run::of_recording(), stage, &file).complete();
        assert_near(undisturbed(), &odometry, 0.5);
    }
}

#[test]
#[ignore = ".ci/nightly: builds a program"]
fn a_begun_project_in_rust_builds_and_keeps_the_contract() {
    let folder = folder();
    for stage in ["masking", "rotation-search", "translation-search"] {
        let project = begun(&folder, stage, &["--rust", "--gyre", crate::PROJECT]);
        let mut build = Command::new("cargo");
        build.current_dir(&project).args(["build", "--quiet"]);
        build.env("CARGO_TARGET_DIR", folder.path().join("target"));
        Ended::of(build).succeeded();
        let program = folder.path().join(format!("target/debug/my-{stage}"));
        finished!["conformance", stage, "--scans", "12", "--command", &program].succeeded();
    }
}

#[test]
fn it_takes_over_in_a_running_run_and_one_that_cannot_be_loaded_does_not() {
    only_if!(python_has("numpy"));
    let run = Run::of_recording().rate("0.5");
    let mut running = run.start();
    let own = running.await_poses(4).await_stage("masking");
    let swap = |text: &str| {
        let (folder, file) = file(text);
        let ended = swap_masking(&run, &["--python", file.to_str().unwrap()]);
        (folder, ended)
    };
    let (_folder, ended) = swap("def mask(scan):\n    return scan.\n");
    ended.refused_with(&["cannot take over", "line 2: SyntaxError"]);
    assert_eq!(running.await_stage("masking"), own);
    let (_folder, ended) = swap("def mask(scan):\n    return scan.power > 0\n");
    ended.succeeded();
    // The command that has swapped it in has ended, and the stage can be started again.
    let swapped = child_with(running.pid(), "--python");
    send(swapped.unwrap(), Signal::KILL);
    assert_eq!(running.complete(), undisturbed());
    assert_eq!(run.summary()["restarts"]["masking"], 1);
}

#[test]
fn it_does_not_take_over_from_a_network_that_looks_at_two_scans() {
    only_if!(python_has("numpy"));
    let model = "shared/method/masking/tests/models/pair-127.toml";
    let model = Path::new(crate::PROJECT).join(model);
    let run = Run::of_recording().rate("1").masked_by(&model);
    let run = run.set("masking.backend=rten");
    let running = run.started(2);
    let (_folder, file) = file("def mask(scan):\n    return scan.power > 0\n");
    swap_masking(&run, &["--python", file.to_str().unwrap()])
        .refused_with(&["cannot take over", "one scan at a time"]);
    running.signal(Signal::INT);
    running.end();
    // In a run that begins with it, it takes the network's place.
    let begun = with(Run::of_recording().masked_by(&model), "masking", &file);
    assert_eq!(begun.complete(), undisturbed());
}
