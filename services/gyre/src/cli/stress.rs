//! The arguments of `gyre stress`.

use std::path::PathBuf;

use clap::Args;
use gyre_messages::StageId;
use gyre_run::Scenario;
use gyre_terminal::inputs::Inputs;

#[derive(Debug, Args)]
pub struct StressArguments {
    /// The configuration, whose section `[budget]` is the verdict, and the recording. Default: the
    /// configuration's simulation, which is rendered first, or its source.data.
    #[command(flatten)]
    pub inputs: Inputs,
    /// A scenario; may be repeated. Default: all.
    #[arg(long = "scenario", value_name = "NAME")]
    pub scenarios: Vec<Scenario>,
    /// Print the scenarios, a line each.
    #[arg(long)]
    pub list: bool,
    /// The folder of the report. Default: `out/stress`.
    #[arg(long, default_value = "out/stress")]
    pub out: PathBuf,
    /// Time for which each scenario is measured, s.
    #[arg(long, value_name = "S", default_value = "60", value_parser = seconds, conflicts_with = "quick")]
    pub duration: f64,
    /// As --duration 10, for continuous integration.
    #[arg(long)]
    pub quick: bool,
    /// The stage that is slowed, stopped or killed; may be repeated. Default: masking is slowed,
    /// all are stopped or killed.
    #[arg(long = "stage", value_name = "NAME", value_parser = stage)]
    pub stages: Vec<StageId>,
    /// For the order of stages that are stopped or killed.
    #[arg(long, default_value_t = 0)]
    pub seed: u64,
}

/// Parses a duration: 2 s to a week.
fn seconds(text: &str) -> Result<f64, String> {
    let seconds = text.parse().ok();
    let seconds = seconds.filter(|seconds| (2.0..=604_800.0).contains(seconds));
    seconds.ok_or_else(|| "a number from 2 to 604800 is needed".to_owned())
}

fn stage(name: &str) -> Result<StageId, String> {
    StageId::by_name(name).ok_or_else(|| {
        let names = StageId::ALL.map(StageId::name).join(", ");
        format!("there is no stage `{name}`; there are {names}")
    })
}
