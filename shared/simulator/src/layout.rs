//! The dataset formats, one file each: names and folders of the images, the files beside them, and
//! the instant of a sweep that is the scan's time.

pub(crate) mod boreas;
pub(crate) mod oxford;
pub(crate) mod radiate;

/// A file beside the images: its path in the dataset's folder, and its content.
pub(crate) type SideFile = (&'static str, String);
