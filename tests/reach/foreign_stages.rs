//! Replaced stages that send what no stage may send: the stage that receives it refuses it by the
//! sender's name, and the poses before it are kept.

mod stages;

use std::{env, process};

use gyre_stage::Launch;

use crate::common::{Run, recording};
use stages::{FAULT, FAULTY, Fault, ONCE};

/// A run with this program in place of a stage; the program sends this fault.
fn run_with(stage: &str, fault: &str, once: bool) -> Run {
    let run = Run::of_recording();
    let marker = run.folder().join("sent");
    let once = match once {
        true => format!("{ONCE}='{}'", marker.display()),
        false => String::new(),
    };
    let program = env::current_exe().unwrap();
    run.stage_script(
        stage,
        &format!(
            "exec env {FAULT}='{fault}' {once} '{}' --exact reach::foreign_stages::plays_a_foreign_stage --nocapture",
            program.display()
        ),
    )
}

/// The limits of each message have tests beside their checks; here, each stage checks its inputs,
/// names sender and field, and keeps only good poses.
#[test]
fn a_message_that_no_stage_may_send_is_refused_by_the_name_of_its_sender() {
    for (stage, fault, field) in [
        ("radar-replay", "scan bins 1000000", "payload"),
        ("radar-replay", "scan stamp 1e18", "stamp"),
        ("masking", "masked n 126", "n is 126"),
        ("masking", "masked point nan", "point 0"),
        ("rotation-search", "rotation angle 4", "angle_rad is 4"),
        ("translation-search", "motion x nan", "x_m is NaN"),
        ("refinement", "refined covariance nan", "covariance"),
        ("pose-integration", "pose x nan", "x_m is NaN"),
    ] {
        let run = run_with(stage, fault, false);
        let ended = run.finish();
        ended.failed_with(&[stage, field]);
        if stage == "pose-integration" {
            continue;
        }
        ended.failed_with(&["giving up"]);
        let odometry = run.odometry();
        let are_numbers = !odometry.contains("NaN") && !odometry.contains("inf");
        assert!(are_numbers, "{fault}: {odometry}");
        let processed = run.summary()["processed"].as_u64().unwrap();
        assert!(processed <= FAULTY, "{fault}: {processed} poses");
    }
}

#[test]
fn a_fault_that_does_not_come_again_costs_a_restart() {
    let run = run_with("translation-search", "motion x nan", true);
    run.finish().succeeded();
    assert!(!run.odometry().contains("NaN"));
    assert_eq!(run.summary()["processed"], recording::SCANS);
    assert_ne!(run.summary()["restarts"], serde_json::json!({}));
}

/// Not a test: the program of a replaced stage, if the environment requests it.
#[test]
fn plays_a_foreign_stage() {
    let Ok(fault) = env::var(FAULT) else { return };
    let fault = Fault::parse(&fault);
    let name = fault.topic.clone();
    let ended = Launch::from_environment(&name).and_then(|launch| stages::play(&launch, fault));
    process::exit(match ended {
        Ok(_) => 0,
        Err(error) => {
            eprintln!("foreign {name}: {error}");
            error.exit_code().into()
        }
    });
}
