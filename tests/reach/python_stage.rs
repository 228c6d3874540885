//! The masking stage in Python, `examples/python-masking`: it keeps the contract, and runs in a
//! pipeline.
//!
//! The tests that start it need its requirements in the Python that `GYRE_PYTHON` names, else in
//! `python3`.

use std::{
    collections::BTreeMap,
    mem::{offset_of, size_of},
    process::Command,
};

use gyre_contract::{
    ByteBlock, FloatBlock, Hop, Item, MaskedHeader, MotionEstimate, MotionHeader, PoseHeader,
    RefinementRecord, RotationEstimate, ScanHeader,
};
use gyre_geometry::samples::{DopplerVelocity, GyroTurn, WheelDistance};
use rustix::process::Signal;
use serde_json::Value;

use crate::{
    PROJECT,
    common::{Run, finished, python, recording, undisturbed},
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

/// The names of messages with their sizes and the offsets of their fields.
macro_rules! layouts {
    ($($name:ident $message:ty: $($field:ident)*;)*) => {
        [$((
            stringify!($name),
            size_of::<$message>(),
            BTreeMap::from([$((stringify!($field), offset_of!($message, $field))),*]),
        )),*]
    };
}

fn layouts() -> [(&'static str, usize, BTreeMap<&'static str, usize>); 12] {
    layouts! {
        gyre_hop_v1 Hop: received_ns started_ns finished_ns published_ns;
        gyre_item_v6 Item: seq scan previous_scan published numbered_from stamp_ns due_ns generation
            flags lost hops;
        gyre_scan_header_v7 ScanHeader: item azimuths bins stride first_byte range_resolution_m
            range_offset_m clockwise doppler_s samples samples_left_out azimuth_stamp_ns azimuth_rad
            azimuth_flags;
        gyre_masked_header_v9 MaskedHeader: item n rasters cell_m mask twist compensated points
            azimuth_variance_rad2 gyro has_gyro wheels has_wheels doppler has_doppler;
        gyre_gyro_turn_v1 GyroTurn: yaw_rad variance_rad2 interval_s sweep_rate_radps;
        gyre_wheel_distance_v1 WheelDistance: distance_m variance_m2 side_variance_m2 interval_s;
        gyre_doppler_velocity_v1 DopplerVelocity: velocity_mps covariance bearings;
        gyre_rotation_estimate_v1 RotationEstimate: angle_rad variance_rad2 score runner_up_rad
            runner_up_score;
        gyre_refinement_v6 RefinementRecord: outcome initial_guess overlap support stationary gyro
            gyro_turn_rad gyro_scale gyro_bias_radps gyro_bias_sigma_radps wheels wheel_distance_m
            wheel_scale wheel_scale_sigma doppler doppler_scale doppler_scale_sigma;
        gyre_motion_estimate_v8 MotionEstimate: x_m y_m yaw_rad covariance drift_share scale_sigma
            interval_ns score runner_up_score rotation searched refinement;
        gyre_motion_header_v11 MotionHeader: item motion;
        gyre_pose_header_v11 PoseHeader: item motion x_m y_m yaw_rad covariance
            accumulated_covariance trajectory_version;
    }
}

#[test]
fn its_messages_are_laid_out_as_those_of_gyre() {
    let mut python = Command::new("python3");
    python.arg(format!("{PROJECT}/examples/python-masking/messages.py"));
    let Ok(output) = python.output() else {
        return println!("skipped: there is no python3");
    };
    assert!(output.status.success(), "{output:?}");
    let printed: Value = serde_json::from_slice(&output.stdout).unwrap();
    for (name, size, offsets) in layouts() {
        let of_python = &printed[name];
        assert_eq!(of_python["size"], size, "{name}");
        let fields = serde_json::to_value(&offsets).unwrap();
        assert_eq!(of_python["offsets"], fields, "{name}");
    }
    for (name, size) in [
        ("gyre_byte_block_v1", size_of::<ByteBlock>()),
        ("gyre_float_block_v1", size_of::<FloatBlock>()),
    ] {
        assert_eq!(printed[name]["size"], size, "{name}");
    }
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
    let summary = run.summary();
    assert_eq!(summary["dropped"], 0);
    assert_eq!(summary["processed"], recording::SCANS);
    assert_eq!(summary["swaps"].as_array().unwrap().len(), 2);
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
