//! The process `refinement` of a run; `gyre run` starts it.

fn main() -> std::process::ExitCode {
    gyre_stage::launch::main(gyre_refinement::NAME, gyre_refinement::run)
}
