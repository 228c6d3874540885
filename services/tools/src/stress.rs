//! Stress tests: does a run meet its deadline under load?
//!
//! Each [`Scenario`] starts real runs, loads or damages them, and watches as an observer of `pose`,
//! whose messages carry the time stamps of every hop. Arrivals do not wait for the pipeline: a scan
//! is due by the source's clock, and latency counts from there.

mod campaign;
pub mod fault;
pub mod helper;
pub mod pipeline;
pub mod processes;
pub mod record;
pub mod report;
mod search;

use std::{ops::Range, path::PathBuf, time::Duration};

use clap::Args;
use gyre_configuration::terminal::inputs::Inputs;
use gyre_contract::{StageId, run::Budget};

pub use campaign::stress;
pub use gyre_contract::run::Scenario;
pub use report::{Provenance, Report};

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
    #[arg(
        long,
        value_name = "S",
        default_value = "60",
        default_value_if("quick", "true", "10")
    )]
    #[arg(value_parser = seconds, conflicts_with = "quick")]
    pub duration: Duration,
    /// As --duration 10, for continuous integration.
    #[arg(long)]
    pub quick: bool,
    /// The stage that is slowed, stopped or killed; may be repeated. Default: masking is slowed,
    /// all are stopped or killed.
    #[arg(long = "stage", value_name = "NAME", value_parser = stage)]
    pub stages: Vec<StageId>,
}

/// Parses a duration: 2 s to a week.
fn seconds(text: &str) -> Result<Duration, String> {
    let seconds = text.parse().ok();
    let seconds = seconds.filter(|seconds| (2.0..=604_800.0).contains(seconds));
    let duration = seconds.map(Duration::from_secs_f64);
    duration.ok_or_else(|| "a number from 2 to 604800 is needed".to_owned())
}

fn stage(name: &str) -> Result<StageId, String> {
    StageId::by_name(name).ok_or_else(|| {
        let names = StageId::ALL.map(StageId::name).join(", ");
        format!("there is no stage `{name}`; there are {names}")
    })
}

#[derive(Clone, Debug)]
pub struct TestedPipeline {
    /// The folder of the report, with the resolved configuration, `config.toml`, whose source is a
    /// recording.
    pub out: PathBuf,
    /// Time between two scans of the recording.
    pub period: Duration,
    /// The scans of a turn of the recording, by their index in it.
    pub turn: Range<usize>,
    pub stages: Vec<StageId>,
    pub budget: Budget,
    pub shared_bytes: u64,
}

impl TestedPipeline {
    /// Returns the seconds of the recording that are played in a second at this rate.
    pub fn relative_rate(&self, rate_hz: f64) -> f64 {
        (rate_hz * self.period.as_secs_f64()).clamp(0.001, 1000.0)
    }

    pub fn run_out(&self, name: &str) -> PathBuf {
        self.out.join("runs").join(name)
    }
}
