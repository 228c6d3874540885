//! A run as data: the sections of its configuration that its processes read, and its report at the
//! end. It needs no transport.

mod budget;
pub mod latency;
mod link;
mod processes;
mod rate;
mod record;
mod report;
mod scenario;
mod scheduling;
mod source;
mod unset;

pub use budget::{Budget, Limits};
pub use link::{LinkConfig, Side};
pub use processes::{EarlierRun, Mode, RestartPolicy, RunConfig, StageConfig};
pub use rate::Rate;
pub use record::RecordConfig;
pub use report::{Ending, Report, StageCounters, Swapped};
pub use scenario::{Judged, RADAR_HZ, Scenario};
pub use scheduling::Scheduling;
pub use source::{PlayedFrom, SourceConfig, SourceKind};

/// The file in the folder of the results with the configuration of the run's begin, TOML.
pub const BEGUN_WITH: &str = "journal/run.toml";
/// The file there with the state of the refinement.
pub const REFINEMENT_STATE: &str = "journal/refinement.map";
/// The file there that a run leaves when it has all its results. The next run starts from the first
/// scan.
pub const COMPLETE: &str = "journal/complete";
/// The open files of the process of a run that has most of them, masking, without observers.
/// Measured: 105.
pub const MOST_OPEN_FILES: u64 = 120;
