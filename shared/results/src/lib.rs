//! The files that a run leaves in the folder of its results ([`Out`]), made from the journal in one
//! pass ([`write`](write())) and read back; and the report on a trajectory beside ground truth
//! ([`evaluate`]).

pub mod evaluate;
pub mod evaluation;
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
mod table;

pub use georeference::georeference;
pub use identity::{Identity, Programs};
pub use out::{
    Content, FILES, Out, OutError, REPLACED, SIMULATED_TRUTH, SUMMARY, absolute, require_results,
    write_page,
};
pub use results::{Results, map_options, truth_of, write};
pub use summary::{Form, HARDLY_MEASURED, Session, Summary};
