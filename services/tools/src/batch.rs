//! Batches: a run for each of many drives, and a table of their results.
//!
//! Each drive is a process, a `gyre run` that ends with this one. The state of a batch is its runs
//! and a [`Row`] for each drive: the same command continues, whatever was killed. Tasks of a batch
//! share only the folder, so that they can run on many computers.
//!
//! Reading order: [`list`], the drives; [`compute`], one process after the other, several at once;
//! [`End`], the result of a process; [`Row`], the file of a drive; `figures`, its columns;
//! [`table`].

mod compute;
mod end;
mod figures;
pub mod list;
mod row;
pub mod table;

pub use compute::{Batch, COMMAND, Ended, compute};
pub use end::{End, Outcome};
pub use list::{Drive, List};
pub use row::{Row, Settings};
