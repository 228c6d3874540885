//! The section `[source]`.

use std::{ops::Range, path::PathBuf, time::Duration};

use gyre_stage::source::Tolerance;
use serde::{Deserialize, Serialize};

/// Where scans come from.
#[derive(
    Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, schemars::JsonSchema,
)]
#[serde(rename_all = "kebab-case")]
pub enum SourceKind {
    /// A recording, or a simulation.
    #[default]
    Recording,
    /// A Navtech radar on the network, by its protocol Colossus.
    Colossus,
}

/// The source of scans: section `[source]`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct SourceConfig {
    /// `recording`, or `colossus`: a Navtech radar on the network, in live mode. Then `data`, `first`,
    /// `retry_s` and `max_unreadable` are not used.
    pub kind: SourceKind,
    /// Address of the radar, as in `192.168.0.1`; its port is 6317 unless it is given.
    #[serde(skip_serializing_if = "String::is_empty")]
    pub address: String,
    /// Time without a byte from the radar after which it is connected to anew, s; 0: no limit.
    pub silence_s: f64,
    /// Folder of the recording; `--data` on the command line.
    pub data: PathBuf,
    /// First scan to play, from 0.
    pub first: usize,
    /// Number of scans to play. Default: all, and of a radar without end.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub scans: Option<usize>,
    /// Time for which a file that the disk or the network does not give is tried again, s. Then the
    /// run ends, and the same command continues it.
    pub retry_s: f64,
    /// Number of damaged scans in a row that are skipped; one more ends the run. Over ten scans at
    /// four per second a car drives farther than the search reaches.
    pub max_unreadable: usize,
}

impl Default for SourceConfig {
    fn default() -> Self {
        Self {
            kind: SourceKind::Recording,
            address: String::new(),
            silence_s: 3.0,
            data: PathBuf::new(),
            first: 0,
            scans: None,
            retry_s: 10.0,
            max_unreadable: 10,
        }
    }
}

impl SourceConfig {
    /// Returns the scans to play of a recording of `scans` scans, by their index in it.
    pub fn played(&self, scans: usize) -> Range<usize> {
        let first = self.first.min(scans);
        let end = first.saturating_add(self.scans.unwrap_or(usize::MAX));
        first..end.min(scans)
    }

    /// Returns the limits on input that cannot be read.
    pub fn tolerance(&self) -> Tolerance {
        Tolerance {
            retry: Duration::try_from_secs_f64(self.retry_s).unwrap_or(Duration::MAX),
            max_unreadable: self.max_unreadable,
        }
    }
}
