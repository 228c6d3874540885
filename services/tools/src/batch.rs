//! Batches: a run for each of many drives, and a table of their results.
//!
//! Each drive is a process, a `gyre run` that ends with this one. The state of a batch is its runs
//! and a [`Row`] for each drive: the same command continues, whatever was killed. Tasks of a batch
//! share only the folder, so that they can run on many computers.

mod compute;
pub mod list;
pub mod table;

pub use compute::{COMMAND, compute};
pub use list::{Drive, List};
pub use table::{End, Outcome, Row};
