//! Files beside the images.

use std::path::PathBuf;

/// A file beside the images: its path in the dataset's folder, and its content.
pub(crate) type SideFile = (PathBuf, Vec<u8>);
