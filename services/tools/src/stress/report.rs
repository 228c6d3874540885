//! The report: `report.json`.

mod figures;
mod outcome;

use std::{fs, path::Path};

use gyre_client::RunError;
use gyre_configuration::terminal::Failure;
use serde::Serialize;

pub use figures::Figures;
pub use outcome::{Check, ScenarioOutcome, Verdict};

/// The version of `report.json`. A key that changes its meaning or goes raises it; one that is
/// added does not.
const VERSION: u32 = 3;

#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Provenance {
    /// The date, UTC.
    pub date: String,
    /// The processor and the number of its cores.
    pub machine: String,
    pub gyre: String,
    /// BLAKE3 digest of the program.
    pub build: String,
    /// The file of the configuration; the resolved one lies beside the report.
    pub configuration: String,
    pub source: String,
}

#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Report {
    version: u32,
    pub provenance: Provenance,
    pub outcomes: Vec<ScenarioOutcome>,
}

impl Report {
    pub fn of(outcomes: Vec<ScenarioOutcome>, provenance: Provenance) -> Self {
        Self {
            version: VERSION,
            provenance,
            outcomes,
        }
    }

    pub fn has(&self, verdict: Verdict) -> bool {
        self.outcomes.iter().any(|it| it.verdict == verdict)
    }

    pub fn write(&self, out: &Path) -> Result<(), Failure> {
        let path = out.join("report.json");
        let text = serde_json::to_string_pretty(self)?;
        Ok(fs::write(&path, text).map_err(RunError::file(&path))?)
    }
}
