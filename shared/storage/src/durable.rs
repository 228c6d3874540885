//! A file that one process at a time changes in place: the common part of logs and of checkpoints.

use std::path::{Path, PathBuf};

use thiserror::Error;

use crate::{File, GroupSync, StorageError, create_folder};

#[derive(Debug, Error)]
#[error("another process is writing to {path}")]
pub struct Busy {
    pub path: PathBuf,
}

/// A file that one process at a time changes in place, and that a thread synchronises.
#[derive(Debug)]
pub struct DurableFile {
    pub file: File,
    pub sync: GroupSync,
}

impl DurableFile {
    /// Opens or creates a file and its folder, and locks it for this process. `prepare` turns the
    /// existing content into a state from where the process continues, before the thread starts.
    pub fn open<E: From<StorageError> + From<Busy>>(
        path: &Path,
        prepare: impl FnOnce(&File) -> Result<(), E>,
    ) -> Result<Self, E> {
        path.parent().map_or(Ok(()), create_folder)?;
        let file = File::open_or_create(path)?;
        if !file.lock()? {
            let path = path.to_owned();
            return Err(Busy { path }.into());
        }
        prepare(&file)?;
        Ok(Self {
            sync: GroupSync::start(&file)?,
            file,
        })
    }

    /// Fills `bytes` with the content of a slot; false if the file ends before.
    /// [`is_sealed`] checks whether it is whole.
    pub fn read(&self, slots: &Slots, slot: u64, bytes: &mut [u8]) -> Result<bool, StorageError> {
        self.file.read_at(bytes, slots.offset(slot))
    }

    /// Writes `bytes` at the start of a slot. [`GroupSync::changed`] counts the writes.
    pub fn write(&self, slots: &Slots, slot: u64, bytes: &[u8]) -> Result<(), StorageError> {
        self.file.write_at(bytes, slots.offset(slot))
    }
}

/// Returns whether a file with these first bytes may be one that begins with `magic`: a death or a
/// power failure leaves a beginning of it, and zeros behind it.
pub(crate) fn may_begin(found: &[u8], magic: &[u8; 16]) -> bool {
    let bytes = found.iter().zip(magic);
    let mut other = bytes.skip_while(|(found, magic)| found == magic);
    other.all(|(found, _)| *found == 0)
}

/// Places of equal size in a file.
#[derive(Clone, Copy, Debug)]
pub struct Slots {
    pub start: u64,
    pub bytes: usize,
}

impl Slots {
    pub const fn offset(&self, slot: u64) -> u64 {
        self.start + slot * self.bytes as u64
    }
}

/// Writes a checksum over the first eight bytes of a slot that proves the others whole.
pub fn seal(slot: &mut [u8]) {
    let (check, content) = slot.split_at_mut(8);
    check.copy_from_slice(&never_zero(content));
}

#[must_use]
pub fn is_sealed(slot: &[u8]) -> bool {
    slot.split_first_chunk()
        .is_some_and(|(check, content)| *check == never_zero(content))
}

/// The CRC-32, little-endian, with one more bit set: an empty slot has zero.
fn never_zero(content: &[u8]) -> [u8; 8] {
    (1 << 32 | u64::from(crc32fast::hash(content))).to_le_bytes()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[derive(Debug, Error)]
    enum TestError {
        #[error(transparent)]
        Storage(#[from] StorageError),
        #[error(transparent)]
        Busy(#[from] Busy),
    }

    #[test]
    fn a_slot_is_whole_until_one_of_its_bytes_changes() {
        let mut slot = [7; 24];
        seal(&mut slot);
        assert!(is_sealed(&slot));
        for at in 0..slot.len() {
            let mut other = slot;
            other[at] ^= 1;
            assert!(!is_sealed(&other), "byte {at}");
        }
        assert!(!is_sealed(&[]));
        assert!(!is_sealed(&[0; 24]), "it is empty");
    }

    #[test]
    fn a_slot_is_read_as_it_was_written_and_only_by_one_process() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("folder").join("file");
        let open = || DurableFile::open::<TestError>(&path, |_| Ok(()));
        let (file, slots) = (open().unwrap(), Slots { start: 3, bytes: 5 });
        file.write(&slots, 2, b"whole").unwrap();
        file.sync.changed().unwrap();
        let mut bytes = [0; 5];
        assert!(file.read(&slots, 2, &mut bytes).unwrap() && bytes == *b"whole");
        assert!(!file.read(&slots, 3, &mut bytes).unwrap());
        assert!(matches!(open(), Err(TestError::Busy(busy)) if busy.path == path));
        drop(file);
        assert!(open().is_ok());
    }
}
