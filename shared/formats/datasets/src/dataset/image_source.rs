//! Recordings that are not on disk.

use std::path::PathBuf;

use super::format::Format;
use super::image_size::ImageSize;

/// A generator of a recording's images on request. [`open_source`](super::open_source) reads them
/// like images on disk.
pub trait ImageSource: Send {
    fn format(&self) -> Format;

    fn size(&self) -> ImageSize;

    /// The folder of images in the corresponding recording on disk, relative to its root.
    fn folder(&self) -> PathBuf;

    /// The image files in that folder, ordered by time.
    fn files(&self) -> Vec<PathBuf>;

    /// The text of the list of stamps beside that folder, in formats whose images have no stamps.
    fn stamps(&self) -> Option<String>;

    /// Writes the image of file `index` to `pixels`, row-major, of size [`ImageSource::size`].
    fn draw(&mut self, index: usize, pixels: &mut [u8]);
}
