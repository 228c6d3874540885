//! Learned masks in a whole run: restarts change nothing, and what does not fit is refused before
//! anything starts.

use std::{
    fs,
    path::{Path, PathBuf},
};

use crate::common::{
    Run, Running, STAGES, odometry, recording, runtime_is_installed, send, undisturbed,
};
use gyre_masking::networks::runtime;
use rustix::process::Signal;

const MIDDLE: usize = recording::SCANS / 3;
const ONE_SCAN: &str = "single-127";
pub const TWO_SCANS: &str = "pair-127";

pub fn card(model: &str) -> PathBuf {
    Path::new(crate::PROJECT)
        .join("shared/method/masking/tests/models")
        .join(model)
        .with_extension("toml")
}

/// A run of the small recording with a learned mask.
fn masked_by(model: &str) -> Run {
    Run::of_recording().masked_by(&card(model))
}

/// Disturbs a run with this model once it is in its middle, and asserts that this changes nothing.
fn survives(model: &str, disturb: impl Fn(&mut Running)) {
    let undisturbed = masked_by(model).complete();
    let run = masked_by(model).rate("6");
    let mut running = run.start();
    running.await_poses(MIDDLE);
    disturb(&mut running);
    let ended = running.finish();
    ended.succeeded();
    assert_eq!(run.odometry(), undisturbed, "{model}: {}", ended.stderr);
    assert_ne!(run.summary()["restarts"], serde_json::json!({}));
}

#[test]
fn a_network_changes_the_motions_and_the_run_says_which_one_it_was() {
    for model in [ONE_SCAN, TWO_SCANS] {
        let run = masked_by(model);
        assert_ne!(run.complete(), undisturbed());
        assert_eq!(run.odometry(), masked_by(model).complete());
        odometry::assert_unbroken(&odometry::rows(&run.odometry()));
        let (said, resolved) = (
            run.summary()["mask"].clone(),
            run.result("config.toml").parse::<toml::Table>().unwrap(),
        );
        assert_eq!(
            said["model"],
            card(model).canonicalize().unwrap().to_str().unwrap()
        );
        assert_eq!(
            said["sha256"],
            resolved["masking"]["sha256"].as_str().unwrap()
        );
    }
}

#[test]
fn a_killed_masking_goes_on_with_a_network_that_looks_at_one_scan() {
    survives(ONE_SCAN, |running| {
        running.kill("masking");
    });
}

#[test]
fn a_killed_masking_goes_on_with_a_network_that_looks_at_two_scans() {
    survives(TWO_SCANS, |running| {
        running.kill("masking");
    });
}

#[test]
#[ignore = "nightly: kills at many moments"]
fn any_killed_stage_goes_on_with_a_network_that_looks_at_two_scans() {
    for stage in STAGES {
        survives(TWO_SCANS, |running| {
            running.kill(stage);
        });
    }
}

#[test]
fn source_and_masking_killed_at_once_go_on_with_a_network_that_looks_at_two_scans() {
    survives(TWO_SCANS, |running| {
        running.kill("radar-replay").kill("masking");
    });
}

#[test]
fn masking_killed_again_after_each_few_poses_goes_on_with_a_network_that_looks_at_two_scans() {
    survives(TWO_SCANS, |running| {
        for poses in [MIDDLE, MIDDLE + 4, MIDDLE + 8] {
            running.await_poses(poses).kill("masking");
        }
    });
}

#[test]
#[ignore = "nightly: kills at many moments"]
fn a_run_that_was_killed_as_a_whole_goes_on_with_a_network_that_looks_at_two_scans() {
    let undisturbed = masked_by(TWO_SCANS).complete();
    let run = masked_by(TWO_SCANS).rate("6");
    // After the very first pose too, where there is no scan before the last one.
    for poses in (1..recording::SCANS).step_by(3) {
        let mut running = run.start();
        running.await_poses(poses);
        running.kill_supervisor();
    }
    assert_eq!(run.complete(), undisturbed);
}

#[test]
fn an_unreadable_scan_between_two_is_stepped_over_by_a_restart() {
    let recording = recording::copy(16);
    recording::truncate(&recording::images(recording.path())[6], 100_000);
    let run =
        || Run::of_recording_named(recording.path().to_str().unwrap()).masked_by(&card(TWO_SCANS));
    let alone = run().complete();
    for poses in [6, 7, 8] {
        let run = run().rate("6");
        let mut running = run.start();
        let stages = running.await_stages();
        running.await_poses(poses);
        stages.values().for_each(|pid| send(*pid, Signal::KILL));
        running.finish().succeeded();
        assert_eq!(run.odometry(), alone, "killed after {poses} poses");
    }
}

#[test]
fn a_live_run_survives_the_death_of_masking_with_a_network_that_looks_at_two_scans() {
    for stages in [
        &["masking"][..],
        &["radar-replay"],
        &["masking", "radar-replay"],
    ] {
        let run = masked_by(TWO_SCANS)
            .rate("4")
            .set("run.mode=live")
            .set("stages.masking.delay_ms=94");
        let mut running = run.start();
        running.await_poses(5);
        for stage in stages {
            running.kill(stage);
        }
        running.finish().succeeded();
        let (summary, count) = (run.summary(), |key: &str| {
            run.summary()[key].as_u64().unwrap()
        });
        assert_eq!(
            count("processed") + count("dropped"),
            count("published"),
            "{stages:?}: {summary}"
        );
        assert!(
            count("dropped") > 0 && count("breaks") <= 1,
            "{stages:?}: {summary}"
        );
    }
}

#[test]
fn gyre_allocates_nothing_for_a_scan_but_what_onnx_runtimes_binding_does() {
    if !runtime_is_installed() {
        return;
    }
    const OF_THE_BINDING: u64 = 3;
    for model in [ONE_SCAN, TWO_SCANS] {
        let run = masked_by(model).set("masking.backend=onnxruntime");
        run.complete();
        let stages = &run.summary()["stages"];
        let scans = recording::SCANS as u64 - 5;
        assert_eq!(
            stages["masking"]["allocations_after_five"],
            OF_THE_BINDING * scans,
            "{}",
            stages["masking"]
        );
        assert_eq!(stages["refinement"]["allocations_after_five"], 0);
    }
}

#[test]
fn a_mask_that_cannot_be_made_is_refused_before_anything_starts() {
    let refused = |run: Run, words: &[&str]| {
        run.finish().refused_with(words);
        assert!(
            !run.out().join("journal").exists(),
            "before anything starts"
        );
    };
    refused(
        Run::of_recording().set("masking.kind=learned"),
        &["masking.model does not name a model"],
    );
    refused(
        masked_by(ONE_SCAN).set("masking.threads=0"),
        &["[masking]", "threads is 0", "1 to 64"],
    );
    refused(
        masked_by(ONE_SCAN).set("masking.runtime=/no/such"),
        &["masking.runtime is /no/such", runtime::INSTALL],
    );
    refused(
        masked_by("single-31"),
        &[
            "raster.n is 127",
            "single-31.toml is for 31",
            "set raster.n = 31",
        ],
    );
    refused(
        masked_by("opset-99").set("raster.n=31"),
        &["opset-99.onnx has operators of version 99"],
    );
    refused(
        masked_by(ONE_SCAN)
            .set("masking.backend=rten")
            .set("masking.provider=cuda"),
        &["provider is a setting of ONNX Runtime", "`onnxruntime`"],
    );
}

#[test]
fn an_onnx_runtime_that_is_named_but_not_there_is_refused_and_other_masks_still_work() {
    let run = masked_by(ONE_SCAN);
    let without = |run: &Run| {
        let mut command = run.command();
        command.env("ORT_DYLIB_PATH", "/no/such/libonnxruntime.so");
        run.start_as(command).finish()
    };
    without(&run).refused_with(&[
        "ORT_DYLIB_PATH is /no/such/libonnxruntime.so",
        runtime::INSTALL,
    ]);
    without(&Run::of_recording()).succeeded();
}

#[test]
fn a_killed_masking_goes_on_with_a_network_in_rten() {
    let masked = || masked_by(TWO_SCANS).set("masking.backend=rten");
    let undisturbed = masked().complete();
    let run = masked().rate("6");
    let mut running = run.start();
    running.await_poses(MIDDLE).kill("masking");
    running.finish().succeeded();
    assert_eq!(run.odometry(), undisturbed);
}

#[test]
fn a_run_from_its_resolved_configuration_is_computed_by_the_same_library() {
    if !runtime_is_installed() {
        return;
    }
    for backend in ["onnxruntime", "rten"] {
        let run = masked_by(ONE_SCAN).set(&format!("masking.backend={backend}"));
        let odometry = run.complete();
        assert_eq!(run.summary()["mask"]["backend"], backend);
        let again = Run::of_file(&run.out().join("config.toml"));
        assert_eq!(again.complete(), odometry);
        assert_eq!(again.summary()["mask"]["backend"], backend);
    }
}

#[test]
fn a_library_in_the_current_folder_is_not_opened_unless_it_is_named() {
    let run = masked_by(ONE_SCAN);
    let decoy = run.folder().join("onnxruntime").join("libonnxruntime.so");
    fs::create_dir(decoy.parent().unwrap()).unwrap();
    fs::write(&decoy, "not a library").unwrap();
    let in_its_folder = |named: Option<&str>, data_home: &str| {
        let mut command = run.command();
        command
            .current_dir(run.folder())
            .env_remove("ORT_DYLIB_PATH")
            .env("HOME", "/no/such/home")
            .env("XDG_DATA_HOME", data_home);
        command.envs(named.map(|path| ("ORT_DYLIB_PATH", path)));
        run.start_as(command).finish()
    };
    for data_home in ["", ".", "gyre/.."] {
        let ended = in_its_folder(None, data_home);
        ended.succeeded();
        assert!(
            ended.stderr.contains("computed by rten"),
            "{}",
            ended.stderr
        );
        fs::remove_dir_all(run.out()).unwrap();
    }
    in_its_folder(Some("onnxruntime"), "").refused_with(&["cannot be used as ONNX Runtime"]);
    let theirs = run.folder().join("data/gyre");
    fs::create_dir_all(&theirs).unwrap();
    fs::rename(decoy.parent().unwrap(), theirs.join("onnxruntime")).unwrap();
    let data_home = theirs.parent().unwrap().to_str().unwrap();
    in_its_folder(None, data_home).refused_with(&["cannot be used as ONNX Runtime"]);
}

#[test]
fn an_unfinished_run_does_not_go_on_with_another_model() {
    let models = tempfile::tempdir().unwrap();
    let ours = models.path().join("mask.toml");
    let install = |name: &str| {
        fs::copy(card(name), &ours).unwrap();
        let file = card(name).with_extension("onnx");
        fs::copy(&file, models.path().join(file.file_name().unwrap())).unwrap();
    };
    install(ONE_SCAN);
    let run = Run::of_recording().masked_by(&ours).rate("6");
    let mut running = run.start();
    running.await_poses(MIDDLE);
    running.kill_supervisor();
    install(TWO_SCANS);
    run.finish()
        .refused_with(&["unfinished run of another configuration", "--fresh"]);
}
