//! The process `pose-integration` of a run; `gyre run` starts it.

fn main() -> std::process::ExitCode {
    gyre_stage::launch::main(gyre_pose_integration::NAME, gyre_pose_integration::run)
}
