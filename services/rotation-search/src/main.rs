//! The process `rotation-search` of a run; `gyre run` starts it.

fn main() -> std::process::ExitCode {
    gyre_stage::launch::main(gyre_rotation_search::NAME, gyre_rotation_search::run)
}
