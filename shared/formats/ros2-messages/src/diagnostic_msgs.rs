//! `diagnostic_msgs`: the health of parts.

use serde::{Deserialize, Serialize};

use crate::{definition::message, std_msgs::Header};

/// A value of a status.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct KeyValue {
    pub key: String,
    pub value: String,
}
message!(
    KeyValue,
    "diagnostic_msgs",
    "string key\nstring value\n",
    []
);

pub const OK: u8 = 0;
pub const WARN: u8 = 1;
pub const ERROR: u8 = 2;
/// Nothing has been heard for some time.
pub const STALE: u8 = 3;

/// The status of a part.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct DiagnosticStatus {
    /// [`OK`], [`WARN`], [`ERROR`] or [`STALE`].
    pub level: u8,
    pub name: String,
    pub message: String,
    /// The hardware of the part.
    pub hardware_id: String,
    pub values: Vec<KeyValue>,
}
message!(
    DiagnosticStatus,
    "diagnostic_msgs",
    "byte OK=0\nbyte WARN=1\nbyte ERROR=2\nbyte STALE=3\nbyte level\nstring name\nstring message\n\
     string hardware_id\nKeyValue[] values\n",
    [KeyValue]
);

/// The status of several parts: the topic `/diagnostics`.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct DiagnosticArray {
    pub header: Header,
    pub status: Vec<DiagnosticStatus>,
}
message!(
    DiagnosticArray,
    "diagnostic_msgs",
    "std_msgs/Header header\nDiagnosticStatus[] status\n",
    [Header, DiagnosticStatus]
);
