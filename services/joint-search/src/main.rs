//! The process `joint-search` of a run; `gyre run` starts it.

fn main() -> std::process::ExitCode {
    gyre_stage::launch::main(gyre_joint_search::NAME, gyre_joint_search::run)
}
