//! The report: `report.json`, and the latency of each scenario scan by scan.

mod figures;
mod outcome;
mod step;

use std::{fmt::Write, fs, path::Path};

use serde::Serialize;

use crate::stress::{
    StressError,
    record::{RunLatency, Sample},
};

pub use figures::Figures;
pub use outcome::{ScenarioOutcome, Verdict};
pub use step::Step;

/// The version of `report.json`. A key that changes its meaning or goes raises it; one that is
/// added does not.
const VERSION: u32 = 2;

/// The origin of a report: computer, program, recording.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Provenance {
    /// The date, UTC.
    pub date: String,
    /// The processor and the number of its cores.
    pub machine: String,
    pub kernel: String,
    /// Gyre's version.
    pub gyre: String,
    /// BLAKE3 digest of the program.
    pub build: String,
    /// The file of the configuration; the resolved one lies beside the report.
    pub configuration: String,
    /// The recording.
    pub source: String,
    /// Load of the machine before the first scenario, in processes: the mean of a minute.
    pub load_before: Option<f64>,
}

/// All outcomes.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Report {
    version: u32,
    /// The origin of the report.
    pub provenance: Provenance,
    /// The scenarios in the order of their execution.
    pub outcomes: Vec<ScenarioOutcome>,
}

impl Report {
    /// A report of these outcomes.
    pub fn of(outcomes: Vec<ScenarioOutcome>) -> Self {
        Self {
            version: VERSION,
            provenance: Provenance::default(),
            outcomes,
        }
    }

    /// Returns whether a scenario has this verdict.
    pub fn has(&self, verdict: Verdict) -> bool {
        self.outcomes
            .iter()
            .any(|outcome| outcome.verdict == verdict)
    }

    /// Writes all its files.
    pub fn write(&self, out: &Path) -> Result<(), StressError> {
        let write = |name: &str, text: String| {
            let path = out.join(name);
            fs::write(&path, text).map_err(StressError::file(path))
        };
        let json = serde_json::to_string_pretty(self);
        write(
            "report.json",
            json.map_err(|error| StressError::Usage(error.to_string()))?,
        )?;
        for outcome in &self.outcomes {
            let measured = outcome.figures.iter();
            for figures in measured.filter(|it| !it.latency.timeline.is_empty()) {
                write(&format!("{}.csv", outcome.scenario), csv(&figures.latency))?;
            }
        }
        Ok(())
    }
}

fn csv(latency: &RunLatency) -> String {
    let mut text = "due_s,latency_ms,dropped\n".to_owned();
    for Sample {
        due_s,
        latency_ms,
        dropped,
    } in &latency.timeline
    {
        let _ = writeln!(text, "{due_s:.6},{latency_ms:.6},{dropped}");
    }
    text
}
