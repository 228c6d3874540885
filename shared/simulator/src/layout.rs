//! A file a format: how images are named and arranged, what lies beside them, and which instant of a sweep is a scan's time.

pub(crate) mod boreas;
pub(crate) mod oxford;
pub(crate) mod radiate;

use std::path::PathBuf;

/// A file beside the images: its path below the dataset's folder, and what is in it.
pub(crate) type SideFile = (PathBuf, Vec<u8>);
