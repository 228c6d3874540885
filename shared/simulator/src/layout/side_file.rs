//! Files beside the images.

use std::path::PathBuf;

/// A file beside the images: its path below the dataset's folder, and what is in it.
pub(crate) type SideFile = (PathBuf, Vec<u8>);
