//! The files that a run leaves in the folder of its results, written and read; and reports of them.
//!
//! - [`Out`]: the folder, which one run at a time may change; [`Content`] decides what may be
//!   written to a place that a user names;
//! - [`write`](write()): all results, made from the journal in one pass;
//! - [`odometry`]: the rows of `odometry.csv`; [`Summary`]: `summary.json`; [`judgement`]: the
//!   evaluation in it;
//! - [`figures`]: all figures of a run, with their names and units;
//! - [`georeference`]: the place of a run on the earth;
//! - [`Identity`]: the inputs of the run at its start;
//! - [`evaluate`]: the report on a trajectory beside ground truth.

pub mod evaluate;
pub mod figures;
mod georeference;
mod identity;
pub mod judgement;
pub mod machine;
pub mod odometry;
mod out;
mod poses;
mod results;
mod summary;

pub use georeference::georeference;
pub use identity::{Holds, Identity, Programs};
pub use out::{
    Content, FILES, Out, OutError, REPLACED, SIMULATED_TRUTH, SUMMARY, absolute, require_results,
    write_page,
};
pub use results::{Results, map_options, truth_of, write};
pub use summary::{Form, Problem, Session, Summary};
