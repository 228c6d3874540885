//! Stress tests: does a run meet its deadline under load?
//!
//! Each [`Scenario`] starts real runs, loads or damages them, and watches as an observer of `pose`,
//! whose messages carry the time stamps of every hop. Arrivals do not wait for the pipeline: a scan
//! is due by the source's clock, and latency counts from there.

mod campaign;
pub mod fault;
pub mod helper;
pub mod load;
pub mod pipeline;
pub mod processes;
pub mod record;
pub mod report;
mod search;
pub mod witness_fault;

use std::{ops::Range, path::PathBuf, time::Duration};

use gyre_contract::{StageId, Witness, run::Budget};

pub use campaign::{Options, stress};
pub use gyre_contract::run::Scenario;
pub use report::{Provenance, Report};

#[derive(Clone, Debug)]
pub struct TestedPipeline {
    /// The resolved configuration, whose source is a recording.
    pub configuration: PathBuf,
    pub out: PathBuf,
    /// Time between two scans of the recording.
    pub period: Duration,
    /// The scans of a turn of the recording, by their index in it.
    pub turn: Range<usize>,
    /// The stamp of the first of them, ns since 1970, if it is known before they are read.
    pub first_ns: Option<i64>,
    pub others: Others,
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

/// The sensors beside the radar that the run uses.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Others {
    /// The kinds that are used, in the order of [`Witness::ALL`].
    pub used: [bool; Witness::ALL.len()],
    /// True if they are weighed against the radar: there is a refinement.
    pub are_weighed: bool,
}
