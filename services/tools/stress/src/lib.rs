//! Stress: whether a run meets its deadline under load.
//!
//! Each [`Scenario`] starts real runs, loads or hurts them, and looks on as an observer of `pose`, whose messages carry the time stamps of
//! every hop. Arrivals do not wait for the pipeline: a scan is due by the source's clock, and latency counts from there.
//!
//! Reading order:
//!
//! 1. [`scenario`]: what there is; [`budget`]: what is asked of it.
//! 2. [`stress`] (in `campaign.rs`): one scenario after the other; [`pipeline`]: one run from its start to its end.
//! 3. [`record`]: poses in, distributions out; drops are samples too.
//! 4. [`fault`], [`helper`], `load`: what is done to a run, and the child processes that load the machine; [`help()`]: the work of one.
//! 5. [`processes`]: what each process uses.
//! 6. [`copying`]: the transport beside copies through sockets.
//! 7. [`report`]: `report.json`, `report.md` and the plots.

pub mod budget;
mod campaign;
pub mod copying;
mod error;
pub mod fault;
mod help;
pub mod helper;
mod load;
pub mod memory;
pub mod pipeline;
pub mod processes;
pub mod record;
pub mod report;
pub mod scenario;
mod search;
mod subject;

pub use budget::{Budget, Limits};
pub use campaign::{Options, stress};
pub use error::StressError;
pub use help::help;
pub use report::{Provenance, Report};
pub use scenario::Scenario;
pub use subject::{Kind, Subject};
