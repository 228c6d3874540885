//! The images of a dataset: their files, order and size.

use std::ffi::OsString;
use std::fmt;
use std::fs::{self, DirEntry};
use std::io;
use std::path::Path;

use super::error::{OpenError, ReadError};
use super::file_list::FileList;
use super::image_size::ImageSize;
use super::image_source::ImageSource;
use super::png_image::{self, ImageReader};
use super::stamp;

/// Number of images tried until one can be read.
const FIRST_TRIES: usize = 8;

/// Images ordered by number, all of the size of the first one.
#[derive(Debug)]
pub(crate) struct Images {
    files: FileList,
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
        Self::listed(folder, list_png(folder)?)
    }

    /// Reads the size from the first image of `files`, those of `folder`, with a valid header.
    pub(crate) fn listed(folder: &Path, files: FileList) -> Result<Self, OpenError> {
        let Some(first) = files.get(0) else {
            return Err(OpenError::NoImages {
                path: folder.to_owned(),
            });
        };
        let size = png_image::read_size(first).or_else(|error| {
            (0..FIRST_TRIES)
                .filter_map(|index| files.get(index))
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
        let (files, size): (FileList, _) = (source.files().into_iter().collect(), source.size());
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

    pub(crate) fn files(&self) -> &FileList {
        &self.files
    }

    /// The file of an image; an empty path past the end.
    pub(crate) fn file(&self, index: usize) -> &Path {
        self.files.get(index).unwrap_or(Path::new(""))
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

    /// Returns the first image that can be decoded, with its index; `None` if the first ones are
    /// damaged.
    ///
    /// # Errors
    /// One of the first ones cannot be read, and none can be decoded.
    pub(crate) fn first_readable(&mut self) -> Result<Option<(usize, Vec<u8>)>, ReadError> {
        let mut pixels = vec![0; self.size.bytes()];
        let mut failed = None;
        for index in 0..self.len().min(FIRST_TRIES) {
            match self.decode(index, &mut pixels) {
                Ok(()) => return Ok(Some((index, pixels))),
                Err(error) => failed = failed.or(error.is_io().then_some(error)),
            }
        }
        failed.map_or(Ok(None), Err)
    }
}

/// Returns the PNG files of a folder: numbered ones by number, then the others by name.
fn list_png(folder: &Path) -> Result<FileList, OpenError> {
    let io_error = |source| OpenError::Io {
        path: folder.to_owned(),
        source,
    };
    let mut names: Vec<(i64, OsString)> = Vec::new();
    for entry in fs::read_dir(folder).map_err(io_error)? {
        if let Some(name) = png_name(&entry.map_err(io_error)?).map_err(io_error)? {
            names.push((file_number(Path::new(&name)).unwrap_or(i64::MAX), name));
        }
    }
    names.sort_unstable();
    Ok(names.iter().map(|(_, name)| folder.join(name)).collect())
}

/// Returns whether a folder exists and holds a PNG.
pub(crate) fn has_png(folder: &Path) -> bool {
    let entries = fs::read_dir(folder).into_iter().flatten().flatten();
    entries
        .map(|entry| png_name(&entry))
        .any(|name| matches!(name, Ok(Some(_))))
}

/// Returns the name of an entry if it is a PNG file, or a link to one.
fn png_name(entry: &DirEntry) -> io::Result<Option<OsString>> {
    let name = entry.file_name();
    let extension = Path::new(&name).extension();
    if !extension.is_some_and(|extension| extension.eq_ignore_ascii_case("png")) {
        return Ok(None);
    }
    // The listing says what an entry is. Only a link must be followed, which costs a system call.
    let kind = entry.file_type()?;
    let is_file = kind.is_file() || (kind.is_symlink() && entry.path().is_file());
    Ok(is_file.then_some(name))
}

fn file_number(path: &Path) -> Option<i64> {
    path.file_stem()?.to_str()?.parse().ok()
}
