//! The process `translation-search` of a run; `gyre run` starts it.

fn main() -> std::process::ExitCode {
    gyre_stage::launch::main(gyre_translation_search::NAME, gyre_translation_search::run)
}
