//! NumPy's `.npy`, format 1.0, written record by record: `numpy.load(path, mmap_mode="r")` opens it
//! without reading it.
//!
//! The number of records is known at the end, so the header leaves room for any number and is
//! written again then. Until the file is complete it has another name. (The crates for `.npy` write
//! no records with an array of a size known at run time, or a header of another length.)

use std::{
    fs::{self, File},
    io::{self, BufWriter, Seek, Write},
    path::{Path, PathBuf},
};

use gyre_configuration::terminal::Failure;

use crate::report::cannot_write;

/// Length of magic, version, and the length of what follows.
const PREFIX_BYTES: usize = 10;
/// NumPy wants the data to begin at a multiple of this.
const ALIGNMENT: usize = 64;

/// A one-dimensional array that grows on the disk. What is dropped before [`NpyWriter::finish`] is
/// removed.
pub struct NpyWriter {
    file: BufWriter<File>,
    path: PathBuf,
    partial: PathBuf,
    dtype: String,
    records: u64,
}

impl NpyWriter {
    /// Begins the array that is to be at `path`, of records that `dtype`, a Python literal,
    /// describes.
    pub fn create(path: &Path, dtype: String) -> Result<Self, Failure> {
        let partial = path.with_added_extension("part");
        let file = File::create(&partial).map_err(cannot_write(&partial))?;
        let mut writer = Self {
            file: BufWriter::new(file),
            path: path.to_owned(),
            partial,
            dtype,
            records: 0,
        };
        writer.write(&header(&writer.dtype, 0))?;
        Ok(writer)
    }

    /// Appends a record.
    pub fn append(&mut self, record: &[u8]) -> Result<(), Failure> {
        self.records += 1;
        self.write(record)
    }

    /// Writes the number of records, and gives the file its name.
    pub fn finish(mut self) -> Result<(), Failure> {
        self.complete().map_err(cannot_write(&self.path))
    }

    fn write(&mut self, bytes: &[u8]) -> Result<(), Failure> {
        self.file.write_all(bytes).map_err(cannot_write(&self.path))
    }

    fn complete(&mut self) -> io::Result<()> {
        self.file.rewind()?;
        self.file.write_all(&header(&self.dtype, self.records))?;
        self.file.flush()?;
        self.file.get_ref().sync_all()?;
        fs::rename(&self.partial, &self.path)
    }
}

impl Drop for NpyWriter {
    /// After [`NpyWriter::finish`] nothing bears the unfinished name any more.
    fn drop(&mut self) {
        let _ = fs::remove_file(&self.partial);
    }
}

/// Returns the header of an array of `records` records, of the same length for any number.
fn header(dtype: &str, records: u64) -> Vec<u8> {
    let dictionary = |records: u64| {
        format!("{{'descr': {dtype}, 'fortran_order': False, 'shape': ({records},), }}")
    };
    let longest = dictionary(u64::MAX).len() + "\n".len();
    let length = (PREFIX_BYTES + longest).next_multiple_of(ALIGNMENT) - PREFIX_BYTES;
    let mut header = b"\x93NUMPY\x01\x00".to_vec();
    header.extend((length as u16).to_le_bytes());
    header.extend(format!("{:<width$}\n", dictionary(records), width = length - 1).into_bytes());
    header
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    const DTYPE: &str = "[('a', '<u2'), ('b', '<f4', (2,))]";

    #[test]
    fn the_header_is_as_the_format_demands_whatever_the_number_of_records() {
        for records in [0, 1, 99_999, u64::MAX] {
            let header = header(DTYPE, records);
            assert_eq!(header.len(), header_bytes());
            assert_eq!(header.len() % ALIGNMENT, 0);
            assert_eq!(&header[..8], b"\x93NUMPY\x01\x00");
            assert_eq!(
                usize::from(u16::from_le_bytes([header[8], header[9]])),
                header.len() - PREFIX_BYTES
            );
            let dictionary =
                format!("{{'descr': {DTYPE}, 'fortran_order': False, 'shape': ({records},), }}");
            let text = std::str::from_utf8(&header[PREFIX_BYTES..]).unwrap();
            assert_eq!(text.trim_end_matches(' ').trim_end(), dictionary);
            assert!(text.ends_with('\n'));
        }
    }

    #[test]
    fn a_complete_file_has_its_name_and_its_number_of_records() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("some.npy");
        let mut writer = NpyWriter::create(&path, DTYPE.to_owned()).unwrap();
        writer.append(&[1; 10]).unwrap();
        assert!(!path.exists());
        writer.append(&[2; 10]).unwrap();
        writer.finish().unwrap();
        let expected = [header(DTYPE, 2), vec![1; 10], vec![2; 10]].concat();
        assert!(fs::read(&path).unwrap() == expected);
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 1);
    }

    #[test]
    fn what_is_given_up_leaves_nothing() {
        let folder = tempfile::tempdir().unwrap();
        let mut writer =
            NpyWriter::create(&folder.path().join("some.npy"), DTYPE.to_owned()).unwrap();
        writer.append(&[1; 10]).unwrap();
        drop(writer);
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 0);
    }

    fn header_bytes() -> usize {
        header(DTYPE, 0).len()
    }
}
