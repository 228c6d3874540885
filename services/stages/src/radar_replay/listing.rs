//! The files of a recording as the run's supervisor has listed them.
//!
//! A source that is restarted need not list the folder again. And it plays the same files under the
//! same numbers, even if files came or went meanwhile.

use std::{
    fs,
    io::{self, ErrorKind},
    path::Path,
};

use gyre_datasets::{Dataset, FileList, Format};

/// The file in the run's root: the name of the format, then the paths, each with a NUL behind it.
const FILE: &str = "recording.list";

#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Listing {
    pub format: Format,
    pub files: FileList,
}

impl Listing {
    pub fn of(dataset: &dyn Dataset) -> Self {
        Self {
            format: dataset.format(),
            files: dataset.files().clone(),
        }
    }

    pub fn write(&self, root: &Path) -> io::Result<()> {
        let format = self.format.name().as_bytes();
        fs::write(root.join(FILE), [format, self.files.as_bytes()].join(&0))
    }

    pub fn read(root: &Path) -> io::Result<Option<Self>> {
        let mut bytes = match fs::read(root.join(FILE)) {
            Err(error) if error.kind() == ErrorKind::NotFound => return Ok(None),
            bytes => bytes?,
        };
        let end = bytes.iter().position(|byte| *byte == 0);
        let files = bytes.split_off(end.map_or(bytes.len(), |end| end + 1));
        let name = bytes
            .strip_suffix(&[0])
            .and_then(|name| str::from_utf8(name).ok());
        let format = name.and_then(Format::by_name);
        Ok(Some(Self {
            format: format.ok_or(ErrorKind::InvalidData)?,
            files: FileList::from_bytes(files),
        }))
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use std::path::PathBuf;

    use super::*;

    #[test]
    fn a_listing_is_read_as_it_was_written() {
        let root = tempfile::tempdir().unwrap();
        assert_eq!(Listing::read(root.path()).unwrap(), None);
        for format in Format::ALL
            .into_iter()
            .chain([Format::Mcap, Format::Ros2Bag])
        {
            let listing = Listing {
                format,
                files: ["a/1.png", "a/2.png"]
                    .map(PathBuf::from)
                    .into_iter()
                    .collect(),
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
