//! A file a format: how images are named and arranged, what lies beside them, and which instant of a sweep is a scan's time.

pub(crate) mod boreas;
pub(crate) mod oxford;
pub(crate) mod radiate;
pub(crate) mod side_file;
