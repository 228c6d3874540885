//! Stress tests: does a run meet its deadline under load?
//!
//! Each [`Scenario`] starts real runs, loads or damages them, and watches as an observer of `pose`,
//! whose messages carry the time stamps of every hop. Arrivals do not wait for the pipeline: a scan
//! is due by the source's clock, and latency counts from there.
//!
//! Reading order:
//!
//! 1. [`Scenario`] and `Budget` of `gyre-run`: the scenarios and their limits; [`check`]: the
//!    verdict.
//! 2. [`stress`] (in `campaign.rs`): one scenario after the other; [`pipeline`]: one run from its
//!    start to its end.
//! 3. [`record`]: poses in, distributions out; drops are samples too.
//! 4. [`fault`]: stops and kills of stages; [`witness_fault`]: faults of gyro, wheels and radar;
//!    [`helper`], `load`: the child processes that load the machine.
//! 5. [`processes`]: the resources of each process.
//! 6. [`report`]: a sentence for each scenario, `report.json`, and the latency scan by scan.

mod campaign;
pub mod check;
mod error;
pub mod fault;
pub mod helper;
pub mod load;
pub mod pipeline;
pub mod processes;
pub mod record;
pub mod report;
mod search;
mod tested;
pub mod witness_fault;

pub use campaign::{Options, stress};
pub use error::StressError;
pub use gyre_run::Scenario;
pub use report::{Provenance, Report};
pub use tested::{Others, TestedPipeline};
