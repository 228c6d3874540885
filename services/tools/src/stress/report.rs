//! The report: `report.json`, and the latency of each scenario scan by scan.

mod figures;
mod outcome;

use std::{fs, path::Path};

use gyre_terminal::Failure;
use serde::Serialize;

use crate::stress::record::RunLatency;

pub use figures::Figures;
pub use outcome::{Check, ScenarioOutcome, Verdict};

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

/// All outcomes, in the order of their execution.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Report {
    version: u32,
    pub provenance: Provenance,
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
        self.outcomes.iter().any(|it| it.verdict == verdict)
    }

    /// Writes all its files.
    pub fn write(&self, out: &Path) -> Result<(), Failure> {
        let write = |name: &str, text: String| {
            let path = out.join(name);
            fs::write(&path, text)
                .map_err(|error| format!("cannot use {}: {error}", path.display()))
        };
        write("report.json", serde_json::to_string_pretty(self)?)?;
        for outcome in &self.outcomes {
            if let Some(figures) = &outcome.figures
                && !figures.latency.timeline.is_empty()
            {
                write(&format!("{}.csv", outcome.scenario), csv(&figures.latency))?;
            }
        }
        Ok(())
    }
}

fn csv(latency: &RunLatency) -> String {
    let rows = latency.timeline.iter().map(|it| {
        let (due_s, latency_ms, dropped) = (it.due_s, it.latency_ms, it.dropped);
        format!("{due_s:.6},{latency_ms:.6},{dropped}\n")
    });
    let header = "due_s,latency_ms,dropped\n".to_owned();
    std::iter::once(header).chain(rows).collect()
}
