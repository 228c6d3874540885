//! The process `radar-replay` of a run; `gyre run` starts it.

fn main() -> std::process::ExitCode {
    gyre_stage::launch::main(gyre_radar_replay::NAME, gyre_radar_replay::run)
}
