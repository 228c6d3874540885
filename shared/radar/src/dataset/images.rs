//! The images of a dataset: their files, order and size.

use std::fmt;
use std::fs;
use std::path::{Path, PathBuf};

use super::error::{OpenError, ReadError};
use super::image_size::ImageSize;
use super::image_source::ImageSource;
use super::png_image::{self, ImageReader};
use super::stamp;

/// Number of images tried until one can be read.
const FIRST_TRIES: usize = 8;

/// Images ordered by number, all of the size of the first one.
#[derive(Debug)]
pub(crate) struct Images {
    files: Vec<PathBuf>,
    pub(crate) size: ImageSize,
    origin: Origin,
}

/// The origin of the pixels.
enum Origin {
    Files(ImageReader),
    Source(Box<dyn ImageSource>),
}

impl fmt::Debug for Origin {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(if matches!(self, Self::Files(_)) {
            "Files"
        } else {
            "Source"
        })
    }
}

impl Images {
    /// Lists `folder` and reads the size from the first image with a valid header.
    pub(crate) fn open(folder: &Path) -> Result<Self, OpenError> {
        let files = list_png(folder)?;
        let Some(first) = files.first() else {
            return Err(OpenError::NoImages {
                path: folder.to_owned(),
            });
        };
        let size = png_image::read_size(first).or_else(|error| {
            files
                .iter()
                .take(FIRST_TRIES)
                .find_map(|f| png_image::read_size(f).ok())
                .ok_or(error)
        })?;
        Ok(Self {
            files,
            size,
            origin: Origin::Files(ImageReader::default()),
        })
    }

    /// Returns the images of a source.
    pub(crate) fn of(source: Box<dyn ImageSource>) -> Result<Self, OpenError> {
        let (files, size) = (source.files(), source.size());
        match files.is_empty() {
            true => Err(OpenError::NoImages {
                path: source.folder(),
            }),
            false => Ok(Self {
                files,
                size,
                origin: Origin::Source(source),
            }),
        }
    }

    pub(crate) fn len(&self) -> usize {
        self.files.len()
    }

    /// The file of an image; an empty path past the end.
    pub(crate) fn file(&self, index: usize) -> &Path {
        self.files
            .get(index)
            .map_or(Path::new(""), PathBuf::as_path)
    }

    /// The number in the name of a file.
    pub(crate) fn number(&self, index: usize) -> Option<i64> {
        file_number(self.file(index))
    }

    /// The time in the name of a file, ns.
    pub(crate) fn name_stamp_ns(&self, index: usize) -> Option<i64> {
        self.number(index).and_then(stamp::to_ns)
    }

    pub(crate) fn decode(&mut self, index: usize, pixels: &mut [u8]) -> Result<(), ReadError> {
        let len = self.files.len();
        let path = self
            .files
            .get(index)
            .ok_or(ReadError::NoSuchScan { index, len })?;
        let (actual, needed) = (pixels.len(), self.size.bytes());
        let pixels = pixels.get_mut(..needed).ok_or(ReadError::SlotTooSmall {
            what: "bytes",
            needed,
            actual,
        })?;
        match &mut self.origin {
            Origin::Files(reader) => reader.decode(path, self.size, pixels),
            Origin::Source(source) => {
                source.draw(index, pixels);
                Ok(())
            }
        }
    }

    /// Returns the first image that can be decoded, with its index.
    pub(crate) fn first_readable(&mut self) -> Option<(usize, Vec<u8>)> {
        let mut pixels = vec![0; self.size.bytes()];
        let index =
            (0..self.len().min(FIRST_TRIES)).find(|i| self.decode(*i, &mut pixels).is_ok())?;
        Some((index, pixels))
    }
}

/// Returns the PNG files of a folder: numbered ones by number, then the others by name.
pub(crate) fn list_png(folder: &Path) -> Result<Vec<PathBuf>, OpenError> {
    let io_error = |source| OpenError::Io {
        path: folder.to_owned(),
        source,
    };
    let mut files = Vec::new();
    for entry in fs::read_dir(folder).map_err(io_error)? {
        let path = entry.map_err(io_error)?.path();
        if path
            .extension()
            .is_some_and(|e| e.eq_ignore_ascii_case("png"))
            && path.is_file()
        {
            files.push(path);
        }
    }
    files.sort_by_cached_key(|path| (file_number(path).unwrap_or(i64::MAX), path.clone()));
    Ok(files)
}

/// Returns whether a folder exists and holds a PNG.
pub(crate) fn has_png(folder: &Path) -> bool {
    folder.is_dir() && list_png(folder).is_ok_and(|files| !files.is_empty())
}

fn file_number(path: &Path) -> Option<i64> {
    path.file_stem()?.to_str()?.parse().ok()
}
