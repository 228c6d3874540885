//! The images of a dataset: their files, order and size.

use std::{
    collections::BTreeSet,
    ops::RangeInclusive,
    path::{Path, PathBuf},
};

use gyre_geometry::scan::MAX_AZIMUTHS;

use super::{
    error::{OpenError, ReadError},
    format::Format,
    image_list::{self, file_number},
    png_image::{self, ImageReader, ImageSize},
    stamp,
};

const FIRST_TRIES: usize = 8;
/// Number of images, spread over all of them, whose sizes are looked at.
const SIZES: usize = 32;

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

/// Images in order, of one width.
pub(crate) struct Images {
    pub(crate) files: Vec<PathBuf>,
    pub(crate) size: ImageSize,
    pub(crate) max_rows: usize,
    reader: ImageReader,
    /// The origin of the pixels, if that is no file.
    source: Option<Box<dyn ImageSource>>,
}

impl Images {
    /// Lists `folder`, and returns its images with sentences on the omitted ones.
    pub(crate) fn open(folder: &Path) -> Result<(Self, Vec<String>), OpenError> {
        let (files, note) = image_list::list(folder)?;
        Ok((Self::listed(folder, files)?, note.into_iter().collect()))
    }

    pub(crate) fn listed(folder: &Path, files: Vec<PathBuf>) -> Result<Self, OpenError> {
        if files.is_empty() {
            return Err(OpenError::no_images(folder));
        }
        let (size, max_rows) = sizes(&files)?;
        Ok(Self {
            files,
            size,
            max_rows,
            reader: ImageReader::default(),
            source: None,
        })
    }

    pub(crate) fn of(source: Box<dyn ImageSource>) -> Result<Self, OpenError> {
        let (files, size) = (source.files(), source.size());
        if files.is_empty() {
            return Err(OpenError::no_images(&source.folder()));
        }
        Ok(Self {
            files,
            size,
            max_rows: size.height,
            reader: ImageReader::default(),
            source: Some(source),
        })
    }

    pub(crate) fn len(&self) -> usize {
        self.files.len()
    }

    /// The file of an image; an empty path past the end.
    pub(crate) fn file(&self, index: usize) -> &Path {
        let file = self.files.get(index);
        file.map_or(Path::new(""), PathBuf::as_path)
    }

    pub(crate) fn number(&self, index: usize) -> Option<i64> {
        file_number(self.file(index))
    }

    pub(crate) fn name_stamp_ns(&self, index: usize) -> Option<i64> {
        self.number(index).and_then(stamp::to_ns)
    }

    pub(crate) fn wrong(&self, format: Format, reason: &str) -> OpenError {
        let fault = format!("is {}, not a {format} image: {reason}", self.size);
        OpenError::at(self.file(0), fault)
    }

    pub(crate) fn decode(
        &mut self,
        index: usize,
        rows: RangeInclusive<usize>,
        pixels: &mut [u8],
    ) -> Result<ImageSize, ReadError> {
        let len = self.files.len();
        let path = self.files.get(index);
        let path = path.ok_or(ReadError::NoSuchScan { index, len })?;
        let pixels = &mut pixels[..self.size.width * rows.end()];
        match &mut self.source {
            None => self.reader.decode(path, self.size, rows, pixels),
            Some(source) => {
                source.draw(index, pixels);
                Ok(self.size)
            }
        }
    }

    pub(crate) fn accepted_rows(&self) -> RangeInclusive<usize> {
        2..=self.max_rows
    }

    /// Returns the first bytes of an image's first row, without reading all of it; `None` if it
    /// cannot be read, or is not on disk.
    pub(crate) fn first_bytes<const N: usize>(&self, index: usize) -> Option<[u8; N]> {
        match self.source {
            None => png_image::first_bytes(self.file(index)),
            Some(_) => None,
        }
    }

    pub(crate) fn keep(&mut self, indices: &[usize]) {
        let paths = indices.iter().map(|index| self.file(*index).to_owned());
        self.files = paths.collect();
    }

    /// Returns the first image with rows of azimuths that can be decoded, its index and its size;
    /// `None` if the first ones are damaged.
    pub(crate) fn first_readable(
        &mut self,
    ) -> Result<Option<(usize, ImageSize, Vec<u8>)>, ReadError> {
        let (rows, mut failed) = (self.accepted_rows(), None);
        let mut pixels = vec![0; self.size.width * rows.end()];
        for index in 0..self.len().min(FIRST_TRIES) {
            match self.decode(index, rows.clone(), &mut pixels) {
                Ok(size) => return Ok(Some((index, size, pixels))),
                Err(error) => failed = failed.or(error.is_io().then_some(error)),
            }
        }
        failed.map_or(Ok(None), Err)
    }
}

/// Returns the size of most images among some, and the rows of the tallest of that width. Where
/// they differ, images between may have a few more.
fn sizes(files: &[PathBuf]) -> Result<(ImageSize, usize), ReadError> {
    let (mut counts, mut failed) = (Vec::<(ImageSize, usize)>::new(), None);
    let spread = (0..files.len()).step_by(files.len().div_ceil(SIZES));
    // Each once: the first ones are no more of the images than others.
    let indices: BTreeSet<usize> = (0..FIRST_TRIES).chain(spread).collect();
    for path in indices.into_iter().filter_map(|index| files.get(index)) {
        match png_image::read_size(path) {
            Ok(size) => match counts.iter_mut().find(|(known, _)| *known == size) {
                Some((_, count)) => *count += 1,
                None => counts.push((size, 1)),
            },
            Err(error) => failed = failed.or(Some(error)),
        }
    }
    // The last of equal ones is the first that was found.
    let most = counts.iter().rev().max_by_key(|(_, count)| *count);
    let Some((size, _)) = most.copied() else {
        return Err(failed.unwrap_or(ReadError::NoSuchScan { index: 0, len: 0 }));
    };
    let most_rows = MAX_AZIMUTHS.max(size.height);
    let is_turn = |other: &ImageSize| other.width == size.width && other.height <= most_rows;
    let of_width = counts.iter().filter(|(other, _)| is_turn(other));
    let rows: Vec<usize> = of_width.map(|(other, _)| other.height).collect();
    let tallest = rows.iter().copied().max().unwrap_or(size.height);
    let more = if rows.len() > 1 { tallest / 20 } else { 0 };
    Ok((size, (tallest + more).min(most_rows)))
}
