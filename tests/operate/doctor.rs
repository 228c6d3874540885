//! `gyre doctor` reports the faults of a machine.

use std::process::Command;

use crate::common::{Ended, folder, gyre, install};

/// Runs it under a limit of the shell.
fn with_limit(limit: &str) -> Ended {
    let mut command = Command::new("sh");
    let script = format!("ulimit {limit}; exec '{}' doctor", crate::PROGRAM);
    command.args(["-c", &script]);
    Ended::of(command)
}

#[test]
fn a_machine_that_runs_these_tests_lacks_nothing_that_a_run_needs() {
    let folder = folder();
    let mut command = gyre();
    command
        .arg("doctor")
        .arg("--out")
        .arg(folder.path().join("a/b"));
    let ended = Ended::of(command);
    assert!(ended.succeeded().stdout.contains("a run works here"));
    for subject in [
        "shared memory",
        "memory",
        "open files",
        "clock",
        "results",
        "ONNX Runtime",
        "Python",
    ] {
        let says = |line: &&str| line.split_at(6).1.starts_with(subject);
        let lines = ended.stdout.lines().filter(|line| line.len() > 6);
        assert_eq!(lines.filter(says).count(), 1, "{subject}: {}", ended.stdout);
    }
    assert!(!ended.stdout.contains("FAILS"), "{}", ended.stdout);
}

#[test]
fn what_a_run_lacks_is_told_with_its_remedy() {
    let ended = with_limit("-n 60");
    assert_eq!(ended.code(), Some(1), "{}", ended.stderr);
    let mut lines = ended.stdout.lines();
    assert!(
        lines.any(|line| line.starts_with("FAILS open files")),
        "{}",
        ended.stdout
    );
    assert!(
        lines
            .next()
            .is_some_and(|remedy| remedy.contains("ulimit -n 1024"))
    );
    assert!(
        ended
            .stdout
            .contains("no run works here while this fails: 1")
    );
}

#[test]
fn a_folder_for_results_that_cannot_be_written_to_is_told() {
    let mut command = gyre();
    command.args(["doctor", "--out", "/proc/results"]);
    let ended = Ended::of(command);
    assert_eq!(ended.code(), Some(1), "{}", ended.stderr);
    assert!(ended.stdout.contains("FAILS results"), "{}", ended.stdout);
}

#[test]
fn without_onnx_runtime_learned_masks_take_longer() {
    let mut command = gyre();
    let nowhere = "/no/such/folder";
    command.arg("doctor").env_remove("ORT_DYLIB_PATH");
    command.env("XDG_DATA_HOME", nowhere).env("HOME", nowhere);
    let ended = Ended::of(command);
    let stdout = &ended.succeeded().stdout;
    assert!(
        stdout.contains("note  ONNX Runtime   none: rten computes learned masks"),
        "{stdout}"
    );
}

#[test]
fn an_onnx_runtime_that_is_named_but_not_there_is_told() {
    let mut command = gyre();
    command
        .arg("doctor")
        .env("ORT_DYLIB_PATH", "/no/such/folder");
    let ended = Ended::of(command);
    let stdout = &ended.succeeded().stdout;
    assert!(
        stdout.contains("note  ONNX Runtime   cannot be used: no learned masks"),
        "{stdout}"
    );
    assert!(
        stdout.contains("ORT_DYLIB_PATH is /no/such/folder"),
        "{stdout}"
    );
}

/// The line of `gyre doctor` about a Python, and its remedy.
fn of_python(python: &str) -> String {
    let mut command = gyre();
    command.arg("doctor").env("GYRE_PYTHON", python);
    let ended = Ended::of(command);
    let mut lines = ended.succeeded().stdout.lines();
    let found = lines.find(|line| line[6..].starts_with("Python")).unwrap();
    let remedy = lines.next().filter(|line| line.contains("->"));
    format!("{found}\n{}", remedy.unwrap_or_default())
}

#[test]
fn the_python_of_functions_is_told_with_its_numpy() {
    let folder = folder();
    let (python, with) = (folder.path().join("python"), folder.path().join("with"));
    // A numpy that stands for one that is installed.
    std::fs::create_dir(&with).unwrap();
    std::fs::write(with.join("numpy.py"), "__version__ = '7.8.9'\n").unwrap();
    let named = python.to_str().unwrap();
    let begin = format!("#!/bin/sh\nPYTHONPATH='{}' exec python3 -S", with.display());
    install(&python, format!("{begin} \"$@\"\n"));
    let told = of_python(named);
    assert!(told.starts_with("ok    Python         /"), "{told}");
    assert!(
        told.contains(", 3.") && told.contains(", with numpy 7.8.9\n"),
        "{told}"
    );
    // -S leaves out the folders of packages.
    std::fs::remove_file(with.join("numpy.py")).unwrap();
    let told = of_python(named);
    assert!(told.starts_with("note  Python         /"), "{told}");
    assert!(
        told.contains("without numpy: no stage can be a function of Python"),
        "{told}"
    );
    assert!(told.contains("-m pip install numpy"), "{told}");
}

#[test]
fn a_python_that_is_none_is_told() {
    for (python, words) in [
        ("/no/such/python", "cannot start /no/such/python: "),
        (
            "/bin/false",
            "/bin/false is no Python of version 3.8 or newer",
        ),
    ] {
        let told = of_python(python);
        let none = "note  Python         none: no stage can be a function of Python\n";
        assert!(told.starts_with(none) && told.contains(words), "{told}");
        assert!(told.contains("GYRE_PYTHON"), "{told}");
    }
}
