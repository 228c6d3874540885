//! Small files of numbers in the run's root: one process writes them, and others read them. Each
//! number is eight bytes, little-endian.

use std::{
    fs::File,
    os::unix::fs::FileExt,
    path::{Path, PathBuf},
};

use crate::{Manifest, RunError, manifest};

#[derive(Debug)]
pub struct Numbers<const N: usize> {
    path: PathBuf,
    file: File,
    written: Option<[u64; N]>,
}

impl<const N: usize> Numbers<N> {
    pub fn open(manifest: &Manifest, name: &str) -> Result<Self, RunError> {
        let path = manifest.root.join(name);
        Ok(Self {
            file: manifest::options()
                .write(true)
                .open(&path)
                .map_err(RunError::file(&path))?,
            path,
            written: None,
        })
    }

    /// Writes the numbers, if they are others than before.
    pub fn write(&mut self, numbers: [u64; N]) -> Result<(), RunError> {
        if self.written == Some(numbers) {
            return Ok(());
        }
        let bytes = numbers.map(u64::to_le_bytes);
        let written = self.file.write_all_at(bytes.as_flattened(), 0);
        written.map_err(RunError::file(&self.path))?;
        self.written = Some(numbers);
        Ok(())
    }
}

/// Returns the first numbers of a file; `None` where it has fewer.
pub fn read<const N: usize>(path: &Path) -> Option<[u64; N]> {
    let mut bytes = [[0; 8]; N];
    let file = File::open(path).ok()?;
    file.read_exact_at(bytes.as_flattened_mut(), 0).ok()?;
    Some(bytes.map(u64::from_le_bytes))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rig::Run;

    #[test]
    fn numbers_are_read_as_they_were_written() {
        let run = Run::begin();
        let mut numbers = Numbers::<2>::open(&run.manifest, "numbers").unwrap();
        numbers.write([1 << 40, u64::MAX]).unwrap();
        let path = run.manifest.root.join("numbers");
        assert_eq!(read::<3>(&path), None);
        assert_eq!(read(&path), Some([1 << 40, u64::MAX]));
        assert_eq!(read(&path), Some([1 << 40]));
    }
}
