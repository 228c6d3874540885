//! Recordings that need not lie on a disk.

use std::path::PathBuf;

use super::format::Format;
use super::image_size::ImageSize;

/// Makes a recording's images when they are asked for. [`open_source`](super::open_source) reads them as it would read the same images
/// from a disk.
pub trait ImageSource: Send {
    /// The form of files that the images have.
    fn format(&self) -> Format;

    /// Columns and rows, the same for all.
    fn size(&self) -> ImageSize;

    /// The folder of images that a recording on disk would have, below its root.
    fn folder(&self) -> PathBuf;

    /// The images' files in that folder, in the order of their times.
    fn files(&self) -> Vec<PathBuf>;

    /// The text of the list of stamps beside that folder, in formats whose images bear none.
    fn stamps(&self) -> Option<String>;

    /// Fills `pixels`, [`ImageSource::size`] of them, row by row, with the image of file `index`.
    fn draw(&mut self, index: usize, pixels: &mut [u8]);
}
