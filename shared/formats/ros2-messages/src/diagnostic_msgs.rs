//! `diagnostic_msgs`: the health of parts.

use crate::{definition::package, std_msgs::Header};

pub const OK: u8 = 0;
pub const WARN: u8 = 1;
pub const ERROR: u8 = 2;
/// Nothing has been heard for some time.
pub const STALE: u8 = 3;

package! { diagnostic_msgs:
    struct KeyValue {
        key: String = "string key",
        value: String = "string value",
    }

    struct DiagnosticStatus {
        /// [`OK`], [`WARN`], [`ERROR`] or [`STALE`].
        level: u8 = "byte OK=0\nbyte WARN=1\nbyte ERROR=2\nbyte STALE=3\nbyte level",
        name: String = "string name",
        message: String = "string message",
        hardware_id: String = "string hardware_id",
        values: Vec<KeyValue> = "KeyValue[] values",
    }

    /// The topic `/diagnostics`.
    struct DiagnosticArray {
        header: Header = "std_msgs/Header header",
        status: Vec<DiagnosticStatus> = "DiagnosticStatus[] status",
    }
}

impl KeyValue {
    pub fn new(key: &str, value: impl ToString) -> Self {
        Self {
            key: key.to_owned(),
            value: value.to_string(),
        }
    }
}

impl DiagnosticStatus {
    pub fn new(name: &str, level: u8, message: String) -> Self {
        Self {
            level,
            name: name.to_owned(),
            message,
            ..Self::default()
        }
    }
}
