//! The files of a recording as the run's supervisor has listed them.
//!
//! A source that is restarted need not list the folder again. And it plays the same files under the
//! same numbers, even if files came or went meanwhile.

use std::{
    ffi::OsStr,
    fs,
    io::{self, ErrorKind},
    iter,
    os::unix::ffi::OsStrExt,
    path::{Path, PathBuf},
};

use gyre_datasets::{Dataset, Format};

/// The file in the run's root: the name of the format, then the paths, each with a NUL behind it.
const FILE: &str = "recording.list";

#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Listing {
    pub format: Format,
    pub files: Vec<PathBuf>,
}

impl Listing {
    pub fn of(dataset: &dyn Dataset) -> Self {
        Self {
            format: dataset.format(),
            files: dataset.files().to_vec(),
        }
    }

    pub fn write(&self, root: &Path) -> io::Result<()> {
        let files = self.files.iter().map(|file| file.as_os_str().as_bytes());
        let names = iter::once(self.format.name().as_bytes()).chain(files);
        let bytes: Vec<u8> = names.flat_map(|name| [name, b"\0"].concat()).collect();
        fs::write(root.join(FILE), bytes)
    }

    pub fn read(root: &Path) -> io::Result<Option<Self>> {
        let bytes = match fs::read(root.join(FILE)) {
            Err(error) if error.kind() == ErrorKind::NotFound => return Ok(None),
            bytes => bytes?,
        };
        // Bytes behind the last NUL are ignored.
        let names = bytes.split_inclusive(|byte| *byte == 0);
        let mut names = names.filter_map(|name| name.strip_suffix(&[0]));
        let format = names.next().and_then(|name| str::from_utf8(name).ok());
        let format = format.and_then(Format::by_name);
        Ok(Some(Self {
            format: format.ok_or(ErrorKind::InvalidData)?,
            files: names.map(|name| OsStr::from_bytes(name).into()).collect(),
        }))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_listing_is_read_as_it_was_written() {
        let root = tempfile::tempdir().unwrap();
        assert_eq!(Listing::read(root.path()).unwrap(), None);
        for format in Format::ALL {
            let listing = Listing {
                format,
                files: ["a/1.png", "a/2.png"].map(PathBuf::from).to_vec(),
            };
            listing.write(root.path()).unwrap();
            assert_eq!(Listing::read(root.path()).unwrap(), Some(listing));
        }
        for text in ["", "oxfort\0a/1.png\0", "oxford"] {
            fs::write(root.path().join(FILE), text).unwrap();
            assert!(Listing::read(root.path()).is_err(), "{text}");
        }
    }
}
