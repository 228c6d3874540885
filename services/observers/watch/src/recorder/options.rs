//! The options of a recording.

use std::path::PathBuf;

use gyre_recording::Split;

pub(crate) const LOG: &str = "log";
pub(crate) const HEALTH: &str = "health";

#[derive(Clone, Debug)]
pub struct Options {
    pub out: PathBuf,
    pub to: PathBuf,
    /// The topics, `log` and `health` among them; empty: the default ones that the run has.
    pub topics: Vec<String>,
    pub split: Split,
    /// True if an existing recording belongs to this run, begun by another recorder: it continues
    /// in its next part.
    pub continues: bool,
}
