//! The files of a recording, in order.

use std::ffi::OsStr;
use std::os::unix::ffi::OsStrExt;
use std::path::{Path, PathBuf};

/// Paths in one piece of memory, as there may be hundreds of thousands.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct FileList {
    bytes: Vec<u8>,
    ends: Vec<usize>,
}

impl FileList {
    pub fn len(&self) -> usize {
        self.ends.len()
    }

    pub fn is_empty(&self) -> bool {
        self.ends.is_empty()
    }

    /// Returns the path of a file; `None` past the end.
    pub fn get(&self, index: usize) -> Option<&Path> {
        let end = *self.ends.get(index)?;
        let before = index.checked_sub(1);
        let start = before.map_or(0, |before| self.ends[before] + 1);
        Some(Path::new(OsStr::from_bytes(&self.bytes[start..end])))
    }

    /// Returns all paths, each with a NUL behind it: the form that [`FileList::from_bytes`] reads.
    pub fn as_bytes(&self) -> &[u8] {
        &self.bytes
    }

    /// Reads paths, each with a NUL behind it; bytes behind the last NUL are ignored.
    pub fn from_bytes(bytes: Vec<u8>) -> Self {
        let is_end = |(_, byte): &(usize, &u8)| **byte == 0;
        let ends = bytes.iter().enumerate().filter(is_end);
        Self {
            ends: ends.map(|(end, _)| end).collect(),
            bytes,
        }
    }
}

impl FromIterator<PathBuf> for FileList {
    fn from_iter<T: IntoIterator<Item = PathBuf>>(paths: T) -> Self {
        let mut list = Self::default();
        for path in paths {
            list.bytes.extend(path.as_os_str().as_bytes());
            list.ends.push(list.bytes.len());
            list.bytes.push(0);
        }
        list
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_list_is_read_as_it_was_written() {
        let paths = ["radar/1.png", "", "radar/b \u{fc}.png"].map(PathBuf::from);
        let list: FileList = paths.iter().cloned().collect();
        let read = FileList::from_bytes(list.as_bytes().to_vec());
        assert_eq!(read, list);
        for (index, path) in paths.iter().enumerate() {
            assert_eq!(read.get(index), Some(path.as_path()));
        }
        assert_eq!((read.len(), read.get(3)), (3, None));
        assert!(FileList::from_bytes(Vec::new()).is_empty());
    }
}
