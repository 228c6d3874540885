//! A run is continued only with the program, the configuration and the recording of its start.

use std::{
    fs,
    path::{Path, PathBuf},
    process::Command,
};

use crate::{
    common::{
        Run, copy_program, install,
        recording::{self, MIDDLE, MODERATE},
        undisturbed,
    },
    method::learned_masks::card,
    operate::commands::ask,
};
use tempfile::TempDir;

fn run_of(recording: &TempDir) -> Run {
    Run::small().data(recording.path())
}

/// Sets another offset of the ranges in `dataset.toml`; returns the file and its content before.
fn change_options(recording: &TempDir) -> (PathBuf, String) {
    let path = recording.path().join("dataset.toml");
    let stored = fs::read_to_string(&path).unwrap();
    let mut options: toml::Table = stored.parse().unwrap();
    options.insert("range_offset_m".to_owned(), 0.5.into());
    fs::write(&path, options.to_string()).unwrap();
    (path, stored)
}

/// A program of its own for a run, which a test can replace.
fn program_in(folder: &Path) -> PathBuf {
    let program = folder.join("gyre-of-the-test");
    copy_program(&program);
    program
}

/// Replaces a program as a build does: under the same name is another file.
fn replace(program: &Path, content: impl AsRef<[u8]>) {
    let new = program.with_extension("new");
    install(&new, content);
    fs::rename(new, program).unwrap();
}

/// Returns the content before: what follows the last section is not executed.
fn make_another_build(program: &Path) -> Vec<u8> {
    let whole = fs::read(program).unwrap();
    replace(program, [&whole[..], b"another build"].concat());
    whole
}

fn by(program: &Path, run: &Run) -> Command {
    let own = run.command();
    let mut command = Command::new(program);
    command.args(own.get_args());
    command
}

#[test]
fn a_stage_restarted_after_a_rebuild_is_still_the_program_that_the_run_was_begun_with() {
    let run = Run::of_recording().rate(MODERATE);
    let program = program_in(run.folder());
    let mut running = run.start_as(by(&program, &run));
    running.await_poses(MIDDLE);
    replace(&program, "#!/bin/sh\necho another program >&2\nexit 7\n");
    running.kill("masking").kill("pose-integration");
    running.finish().succeeded().does_not_say("another program");
    assert_eq!(run.odometry(), undisturbed());
}

fn install_model(name: &str, ours: &Path) {
    fs::copy(card(name), ours).unwrap();
    let file = card(name).with_extension("onnx");
    fs::copy(&file, ours.with_file_name(file.file_name().unwrap())).unwrap();
}

/// An image is missing and then truncated, which is refused, and put back.
fn change_image(recording: &TempDir, refused: impl Fn(&[&str])) {
    let image = &recording::images(recording.path())[20];
    let away = recording.path().join("away.png");
    fs::rename(image, &away).unwrap();
    refused(&["another recording", "it had 24 scans and now has 23"]);
    fs::copy(&away, image).unwrap();
    recording::truncate(image, 50_000);
    refused(&["another recording", "its images had"]);
    fs::rename(&away, image).unwrap();
}

/// One after the other is changed, refused by name, and put back; the same command continues.
#[test]
fn unfinished_and_complete_runs_are_kept_until_they_are_replaced_on_purpose() {
    let mut results = Vec::new();
    for state in ["unfinished run of another", "complete run of another"] {
        let recording = recording::copy(recording::SCANS);
        let models = tempfile::tempdir().unwrap();
        let ours = models.path().join("mask.toml");
        install_model("single-127", &ours);
        let run = run_of(&recording).masked_by(&ours);
        let run = run.set("masking.backend=rten");
        if state.starts_with("complete") {
            run.complete();
        } else {
            run.interrupt(MODERATE, MIDDLE);
        }
        let refused = |run: &Run, words: &[&str]| {
            let ended = run.finish();
            ended.refused_with(&[state, "--out", "--fresh"]);
            ended.refused_with(words);
        };
        for (sentence, words) in [
            ("raster.cell_m=0.9", ["raster.cell_m was 0.8", "is now 0.9"]),
            ("refinement.keyframes=3", ["configuration", "keyframes"]),
            ("refinement.kind=none", ["configuration", "refinement"]),
            ("slam.kind=graph", ["configuration", "slam.kind"]),
        ] {
            refused(&run.clone().set(sentence), &words);
        }
        install_model("pair-127", &ours);
        refused(&run, &["another configuration"]);
        install_model("single-127", &ours);
        let (path, stored) = change_options(&recording);
        refused(&run, &["dataset.range_offset_m was", "is now 0.5"]);
        fs::write(&path, stored).unwrap();
        change_image(&recording, |words| refused(&run, words));
        let program = program_in(run.folder());
        let whole = make_another_build(&program);
        let ended = run.start_as(by(&program, &run)).finish();
        ended.refused_with(&[state, "program", "gyre was build", "and is now build"]);
        replace(&program, whole);
        run.start_as(by(&program, &run)).finish().succeeded();
        results.push(run.odometry());
        let other = run.clone().set("refinement.kind=none").option("--fresh");
        assert_ne!(other.complete(), results[0]);
    }
    assert_eq!(results[0], results[1]);
}

#[test]
fn a_replaced_stage_whose_program_changes_during_the_run_is_not_started_again() {
    let run = Run::of_recording()
        .rate(MODERATE)
        .stage_script("masking", "exec '{gyre}' stage masking");
    let script = run.folder().join("masking.sh");
    let whole = fs::read(&script).unwrap();
    let mut running = run.started(MIDDLE);
    replace(&script, "#!/bin/sh\nexit 7\n");
    running.kill("masking");
    running.finish().failed_with(&[
        "masking has ended",
        "masking.sh has changed since",
        "poses are kept",
    ]);
    run.finish().refused_with(&[
        "unfinished run of another program",
        "the program of masking is another one",
    ]);
    replace(&script, whole);
    assert_eq!(run.complete(), undisturbed());
}

#[test]
fn a_stage_of_another_build_is_refused() {
    let run = Run::of_recording();
    let program = program_in(run.folder());
    make_another_build(&program);
    let command = format!(
        "stages.masking.command=['{}','stage','masking']",
        program.display()
    );
    let run = run.set(&command);
    run.finish().failed_with(&["another build of gyre"]);
    let logged = ask(&run, &["logs", "masking"]).stdout;
    assert!(logged.contains("ERROR masking: this is another build"));
    ask(&run, &["ps"]).refused_with(&["the run failed: masking: this is another build"]);
}

#[test]
fn options_that_change_during_a_run_do_not_change_it() {
    let recording = recording::copy(recording::SCANS);
    let run = run_of(&recording).rate(MODERATE);
    let mut running = run.started(MIDDLE);
    change_options(&recording);
    running.kill("radar-replay");
    assert_eq!(running.complete(), undisturbed());
}
