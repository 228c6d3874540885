//! The work of a helper, which it gets as JSON on its command line.

use std::path::PathBuf;

use serde::{Deserialize, Serialize};

use crate::hand_over::HandOver;

/// The work of a helper.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Work {
    /// Becomes `gyre` with these arguments, and ends its stages first.
    Run(Vec<String>),
    /// Computes without end.
    Spin,
    /// Takes this share of the available memory, and churns it.
    Memory(f64),
    /// Reads all topics of the run that writes to this folder.
    Observe(PathBuf),
    /// Sends the messages of a hand-over.
    Send(HandOver),
    /// Reads them.
    Read(HandOver),
}
