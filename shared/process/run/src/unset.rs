//! Values that a configuration leaves out when it is written.

use std::path::Path;

pub(crate) fn is_zero(value: &u64) -> bool {
    *value == 0
}

pub(crate) fn is_empty(path: &Path) -> bool {
    path.as_os_str().is_empty()
}
