//! Learned masks in a whole run.

use std::{
    fs,
    path::{Path, PathBuf},
};

use crate::common::{Run, odometry, recording, runtime_is_installed, undisturbed};

const ONE_SCAN: &str = "single-127";
pub const TWO_SCANS: &str = "pair-127";

pub fn card(model: &str) -> PathBuf {
    Path::new(crate::PROJECT)
        .join("shared/method/masking/tests/models")
        .join(model)
        .with_extension("toml")
}

fn masked_by(model: &str) -> Run {
    Run::of_recording().masked_by(&card(model))
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
        let path = card(model).canonicalize().unwrap();
        assert_eq!(said["model"], path.to_str().unwrap());
        let sha256 = &resolved["masking"]["sha256"];
        assert_eq!(said["sha256"], sha256.as_str().unwrap());
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
        let allocations = &stages["masking"]["allocations_after_five"];
        assert_eq!(*allocations, OF_THE_BINDING * scans);
        assert_eq!(stages["refinement"]["allocations_after_five"], 0);
    }
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
fn a_file_that_is_no_library_is_refused() {
    let run = masked_by(ONE_SCAN);
    let named = run.folder().join("libonnxruntime.so");
    fs::write(&named, "not a library").unwrap();
    let mut command = run.command();
    command.env("ORT_DYLIB_PATH", &named);
    let ended = run.start_as(command).finish();
    ended.refused_with(&["cannot be used as ONNX Runtime"]);
}
