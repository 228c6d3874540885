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
    pub(crate) const ALL: [Self; 2] = [Self::SharedMemory, Self::Sockets];

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
    pub(crate) medium: Medium,
    /// The folder that names the topic, or the socket.
    pub(crate) place: PathBuf,
    pub(crate) bytes: usize,
    pub(crate) messages: u64,
    pub(crate) readers: usize,
}

impl HandOver {
    /// Returns the path of the socket.
    pub(crate) fn socket(&self) -> PathBuf {
        self.place.join("socket")
    }
}
