//! Batches: a run for each of many drives, and a table of their results.
//!
//! Each drive is a process of its own, which is a `gyre run` that ends with this one. The state of
//! a batch is its runs and a file for each drive, its [`DriveRow`]: whatever is killed, the same
//! command continues. Tasks of a batch share only the folder, so that they can be on many
//! computers.
//!
//! Reading order:
//!
//! 1. [`list`]: the drives; [`DriveOutcome`]: the ends of one.
//! 2. [`Batch`]: drives, settings, folder; [`compute`]: one run after the other, several at once;
//!    `child.rs`: one of them.
//! 3. [`row`]: the file of a drive; `columns`: its figures; [`table`]: `results.csv` and
//!    `times.csv`.

mod batch;
mod child;
mod columns;
mod compute;
mod error;
pub mod list;
mod outcome;
pub mod row;
pub mod table;

pub use batch::Batch;
pub use child::COMMAND;
pub use columns::Values;
pub use compute::{Ended, compute};
pub use error::BatchError;
pub use list::{Drive, List, Slice};
pub use outcome::DriveOutcome;
pub use row::{DriveRow, Settings};
pub use table::{Table, collect};
