//! The process `masking` of a run; `gyre run` starts it.

fn main() -> std::process::ExitCode {
    gyre_stage::launch::main(gyre_masking::NAME, gyre_masking::run)
}
