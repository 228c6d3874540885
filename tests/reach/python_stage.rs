//! The masking stage in Python, `examples/python-masking`: it keeps the contract, and runs in a
//! pipeline.
//!
//! The tests that start it need its requirements in the Python that `GYRE_PYTHON` names, else in
//! `python3`.

use std::process::Command;

use gyre_contract::layout::Layout;
use rustix::process::Signal;

use crate::{
    PROJECT,
    common::{Run, finished, python, undisturbed},
    reach::{assert_near, only_if, python_has, swap_masking},
};

/// The Python and the script.
pub fn command() -> [String; 2] {
    [
        python(),
        format!("{PROJECT}/examples/python-masking/masking.py"),
    ]
}

/// Returns whether the stage can be started; prints why a test is skipped.
pub fn can_start() -> bool {
    python_has("iceoryx2, numpy")
}

pub fn with_python(run: Run) -> Run {
    let [python, script] = command();
    run.set(&format!("stages.masking.command=['{python}', '{script}']"))
}

#[test]
fn its_messages_are_laid_out_as_those_of_gyre() {
    let kept = include_str!("../../examples/python-masking/messages.json");
    let layout = serde_json::to_string_pretty(&Layout::new()).unwrap();
    assert!(
        kept.trim() == layout,
        "write it anew: gyre schema --messages > examples/python-masking/messages.json"
    );
    let script = format!("{PROJECT}/examples/python-masking/messages.py");
    let Ok(output) = Command::new("python3").arg(script).output() else {
        return println!("skipped: there is no python3");
    };
    // It asserts sizes and offsets.
    assert!(output.status.success(), "{output:?}");
}

#[test]
#[ignore = ".ci/nightly: starts Python often"]
fn it_keeps_the_contract_of_masking() {
    only_if!(can_start());
    let words =
        "conformance masking --scans 12 --set raster.n=63 --stop-timeout-s 30 --patience-s 60";
    finished![; words.split(' '); ["--command", &command().join(" ")]].succeeded();
}

#[test]
fn its_motions_are_those_of_the_own_masking_to_a_centimetre() {
    only_if!(can_start());
    let python = with_python(Run::of_recording()).complete();
    assert_near(undisturbed(), &python, 0.01);
}

#[test]
fn it_takes_over_in_a_running_pipeline_and_gives_way_again() {
    only_if!(can_start());
    // Twelve seconds: Python starts slowly where the machine is busy.
    let run = Run::of_recording().rate("0.5");
    let mut running = run.started(4);
    swap_masking(&run, &["--command", &command().join(" ")]).succeeded();
    running.await_poses(12);
    swap_masking(&run, &[]).succeeded();
    running.finish().succeeded();
    run.assert_counts("dropped=0 processed=24");
    assert_eq!(run.summary()["swaps"].as_array().unwrap().len(), 2);
    assert_near(undisturbed(), &run.odometry(), 0.01);
}

#[test]
fn a_run_that_it_cannot_serve_is_refused_before_the_stage_gives_way() {
    only_if!(can_start());
    let run = Run::of_recording().rate("0.5");
    let run = run.set("masking.undo_doppler=true");
    let mut running = run.start();
    let own = running.await_poses(2).await_stage("masking");
    swap_masking(&run, &["--command", &command().join(" ")])
        .refused_with(&["cannot take over", "set masking.undo_doppler to false"]);
    assert_eq!(running.await_stage("masking"), own);
    running.signal(Signal::INT);
    running.end();
}
