//! `gyre stage NAME`: one process of a run.

use std::process::ExitCode;

use gyre_messages::Stage;
use gyre_stage::{Launch, StageError, Statistics, launch};

/// Runs a stage by its name.
pub fn run(name: &str) -> ExitCode {
    let work: fn(&Launch) -> Result<Statistics, StageError> = match name {
        gyre_radar_replay::NAME => gyre_radar_replay::run,
        gyre_masking::NAME => gyre_masking::run,
        gyre_rotation_search::NAME => gyre_rotation_search::run,
        gyre_translation_search::NAME => gyre_translation_search::run,
        gyre_joint_search::NAME => gyre_joint_search::run,
        gyre_refinement::NAME => gyre_refinement::run,
        gyre_pose_integration::NAME => gyre_pose_integration::run,
        _ => {
            eprintln!(
                "gyre: there is no stage `{name}`; there are {}",
                Stage::ALL.map(Stage::name).join(", ")
            );
            return ExitCode::FAILURE;
        }
    };
    launch::main(name, work)
}
