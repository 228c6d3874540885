//! Batches: a run for each of many drives, and a table of what they gave.
//!
//! Each drive is a process of its own, which is a `gyre run` that ends with this one. Nothing is kept of a batch but its runs and a file for
//! each drive, its [`Row`]: whatever is killed, the same command goes on. Tasks of a batch share nothing but the folder, so that they can be on
//! many computers.
//!
//! Reading order:
//!
//! 1. [`list`]: the drives; [`Outcome`]: how one can end.
//! 2. [`Batch`]: what is to be done; [`compute`]: one run after the other, several at once; `child.rs`: one of them.
//! 3. [`row`]: what is kept of a drive; [`table`]: `results.csv` and `times.csv`.

mod batch;
mod child;
mod compute;
mod error;
pub mod list;
mod outcome;
pub mod row;
pub mod table;

pub use batch::Batch;
pub use child::COMMAND;
pub use compute::{Ended, compute};
pub use error::BatchError;
pub use list::{Drive, List, Slice};
pub use outcome::Outcome;
pub use row::{Row, Settings};
pub use table::{Table, collect};
