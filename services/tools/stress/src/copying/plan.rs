//! One hand-over, as its processes know it.

use std::path::PathBuf;

use serde::{Deserialize, Serialize};

/// The medium of messages.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Medium {
    /// Shared memory, without copying.
    SharedMemory,
    /// Unix stream sockets, by copying.
    Sockets,
}

impl Medium {
    pub(super) const ALL: [Self; 2] = [Self::SharedMemory, Self::Sockets];

    /// Returns its name.
    pub const fn name(self) -> &'static str {
        match self {
            Self::SharedMemory => "shared memory",
            Self::Sockets => "sockets",
        }
    }
}

/// The plan of one hand-over.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct HandOver {
    pub(super) medium: Medium,
    /// The folder that names the topic, or the socket.
    pub(super) place: PathBuf,
    pub(super) bytes: usize,
    pub(super) messages: u64,
    pub(super) readers: usize,
}

impl HandOver {
    /// Returns the path of the socket.
    pub(super) fn socket(&self) -> PathBuf {
        self.place.join("socket")
    }
}
