//! `gyre doctor` reports the faults of a machine.

use std::{fs, process::Command};

use crate::common::{Ended, folder, gyre, install};

/// Runs it with these variables of the environment.
fn with(variables: &[(&str, &str)]) -> String {
    let mut command = gyre();
    command.arg("doctor").env_remove("ORT_DYLIB_PATH");
    command.envs(variables.iter().copied());
    Ended::of(command).succeeded().stdout.clone()
}

#[test]
fn a_machine_that_runs_these_tests_lacks_nothing_that_a_run_needs() {
    let said = with(&[]);
    let works = said.contains("a run works here");
    assert!(works && !said.contains("FAILS"), "{said}");
    for subject in ["shared memory", "cpu governor", "ONNX Runtime", "Python"] {
        let lines = said.lines().filter(|line| line.len() > 6);
        let lines = lines.filter(|line| line.split_at(6).1.starts_with(subject));
        assert_eq!(lines.count(), 1, "{subject}: {said}");
    }
}

/// `gyre doctor` leaves that to the run.
#[test]
fn a_run_names_the_limit_of_open_files_that_stops_it() {
    let script = "ulimit -n 60; exec \"$0\" demo --out \"$1\"";
    let (folder, mut command) = (folder(), Command::new("sh"));
    command.args(["-c", script, crate::PROGRAM]);
    command.arg(folder.path().join("out"));
    Ended::of(command).failed_with(&["60 open files", "ulimit -n 1024"]);
}

#[test]
fn an_onnx_runtime_that_is_missing_or_not_where_it_is_named_is_reported() {
    let nowhere = "/no/such/folder";
    let said = with(&[("XDG_DATA_HOME", nowhere), ("HOME", nowhere)]);
    let note = "note  ONNX Runtime   none: rten computes learned masks";
    assert!(said.contains(note), "{said}");
    let said = with(&[("ORT_DYLIB_PATH", nowhere)]);
    let note = "note  ONNX Runtime   cannot be used: no learned masks";
    assert!(said.contains(note), "{said}");
    assert!(said.contains("ORT_DYLIB_PATH is /no/such/folder"), "{said}");
}

/// The line of `gyre doctor` about a Python, and its remedy.
fn of_python(python: &str) -> String {
    let said = with(&[("GYRE_PYTHON", python)]);
    let mut lines = said.lines();
    let found = lines.find(|line| line[6..].starts_with("Python")).unwrap();
    let remedy = lines.next().filter(|line| line.contains("->"));
    format!("{found}\n{}", remedy.unwrap_or_default())
}

#[test]
fn the_python_of_functions_is_reported_with_its_numpy() {
    let folder = folder();
    let (python, with) = (folder.path().join("python"), folder.path().join("with"));
    // A numpy that stands for one that is installed.
    fs::create_dir(&with).unwrap();
    fs::write(with.join("numpy.py"), "__version__ = '7.8.9'\n").unwrap();
    let named = python.to_str().unwrap();
    let begin = format!("#!/bin/sh\nPYTHONPATH='{}' exec python3 -S", with.display());
    install(&python, format!("{begin} \"$@\"\n"));
    let found = of_python(named);
    assert!(found.starts_with("ok    Python         /"), "{found}");
    let numpy = ", with numpy 7.8.9\n";
    assert!(found.contains(", 3.") && found.contains(numpy), "{found}");
    // -S leaves out the folders of packages.
    fs::remove_file(with.join("numpy.py")).unwrap();
    let found = of_python(named);
    assert!(found.starts_with("note  Python         /"), "{found}");
    let lacking = "without numpy: no stage can be a function of Python";
    let remedy = "-m pip install numpy";
    assert!(found.contains(lacking) && found.contains(remedy), "{found}");
    for (python, words) in [
        ("/no/such/python", "cannot start /no/such/python: "),
        (
            "/bin/false",
            "/bin/false is no Python of version 3.8 or newer",
        ),
    ] {
        let found = of_python(python);
        let none = "note  Python         none: no stage can be a function of Python\n";
        assert!(found.starts_with(none) && found.contains(words), "{found}");
        assert!(found.contains("GYRE_PYTHON"), "{found}");
    }
}
