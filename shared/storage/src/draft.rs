//! Files that are replaced as a whole.

use std::{
    ffi::OsString,
    fs, io,
    path::{Path, PathBuf},
};

#[cfg(feature = "record")]
use crate::record::{self, Operation};
use crate::{File, StorageError, folder::sync_folder};

/// The name of a draft is the name of its file between these.
const AHEAD: &str = ".";
const BEHIND: &str = ".tmp";
/// Processes that write drafts of one file at once.
const WRITERS: usize = 64;
/// Bytes that are collected before they are written.
const BUFFER: usize = 1 << 18;

/// The next content of a file, written aside as `.NAME.tmp`; where another process is writing that,
/// as `.NAME.1.tmp` and so on. It takes the place of the file when it is committed; dropped before
/// that, it is removed.
#[derive(Debug)]
pub struct Draft {
    path: PathBuf,
    aside: PathBuf,
    file: File,
    /// Bytes in the file, and those that are not written yet.
    written: u64,
    buffer: Vec<u8>,
    committed: bool,
}

impl Draft {
    pub fn create(path: &Path) -> Result<Self, StorageError> {
        let failed = StorageError::at("write", path);
        for writer in 0..WRITERS {
            let aside = aside(path, writer);
            if let Some(file) = File::create(&aside).map_err(|error| failed(error.source))? {
                return Ok(Self {
                    path: path.to_owned(),
                    aside,
                    file,
                    written: 0,
                    buffer: Vec::with_capacity(BUFFER),
                    committed: false,
                });
            }
        }
        let reason = format!("{WRITERS} other processes are writing it");
        Err(failed(io::Error::new(io::ErrorKind::ResourceBusy, reason)))
    }

    pub fn path(&self) -> &Path {
        &self.path
    }

    pub fn append(&mut self, bytes: impl AsRef<[u8]>) -> Result<(), StorageError> {
        let bytes = bytes.as_ref();
        if self.buffer.len() + bytes.len() > BUFFER {
            self.flush()?;
        }
        if bytes.len() > BUFFER {
            // So a large file is not held twice.
            return self.write(bytes);
        }
        self.buffer.extend_from_slice(bytes);
        Ok(())
    }

    fn flush(&mut self) -> Result<(), StorageError> {
        let mut buffer = std::mem::take(&mut self.buffer);
        let written = self.write(&buffer);
        buffer.clear();
        self.buffer = buffer;
        written
    }

    fn write(&mut self, bytes: &[u8]) -> Result<(), StorageError> {
        let written = self.file.write_at(bytes, self.written);
        written.map_err(|error| StorageError::at("write", &self.path)(error.source))?;
        self.written += bytes.len() as u64;
        Ok(())
    }

    /// Makes the draft the content of the file: after a kill or a power failure the file has the
    /// whole of the old or of the new content. The new one is sure to survive once the folder is
    /// synchronised too ([`sync_folder`]).
    pub fn commit(mut self) -> Result<(), StorageError> {
        self.flush()?;
        self.file.sync()?;
        fs::rename(&self.aside, &self.path).map_err(StorageError::at("write", &self.path))?;
        self.committed = true;
        #[cfg(feature = "record")]
        record::push(&self.path, || Operation::Rename {
            from: self.aside.clone(),
            to: self.path.clone(),
        });
        Ok(())
    }
}

impl Drop for Draft {
    fn drop(&mut self) {
        if !self.committed {
            // What stays is overwritten by the next draft.
            let _ = crate::remove(&self.aside);
        }
    }
}

fn aside(path: &Path, writer: usize) -> PathBuf {
    let mut name = OsString::from(AHEAD);
    name.push(path.file_name().unwrap_or_default());
    if writer > 0 {
        name.push(format!(".{writer}"));
    }
    name.push(BEHIND);
    path.with_file_name(name)
}

/// Returns whether a file of this name is a draft, as a killed process leaves it.
pub fn is_draft(path: &Path) -> bool {
    let name = path.file_name().unwrap_or_default().as_encoded_bytes();
    name.starts_with(AHEAD.as_bytes()) && name.ends_with(BEHIND.as_bytes())
}

/// Replaces a file as a whole. It survives a power failure when this returns.
pub fn write(path: &Path, bytes: impl AsRef<[u8]>) -> Result<(), StorageError> {
    let mut draft = Draft::create(path)?;
    draft.append(bytes)?;
    draft.commit()?;
    path.parent().map_or(Ok(()), sync_folder)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn names(folder: &Path) -> Vec<String> {
        let entries = fs::read_dir(folder).unwrap();
        entries
            .map(|entry| entry.unwrap().file_name().into_string().unwrap())
            .collect()
    }

    #[test]
    fn a_file_keeps_its_content_until_its_draft_is_committed() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("summary.json");
        fs::write(
            folder.path().join(".summary.json.tmp"),
            "of a killed process",
        )
        .unwrap();
        write(&path, "old").unwrap();
        let mut draft = Draft::create(&path).unwrap();
        draft.append("new").unwrap();
        assert!(is_draft(&draft.aside) && !is_draft(&path));
        assert_eq!(fs::read_to_string(&path).unwrap(), "old");
        draft.commit().unwrap();
        assert_eq!(fs::read_to_string(&path).unwrap(), "new");
        assert_eq!(names(folder.path()), ["summary.json"]);
    }

    #[test]
    fn writers_at_once_do_not_remove_the_drafts_of_each_other() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("results.csv");
        let all = |of: usize| of.to_string().repeat(1000);
        std::thread::scope(|scope| {
            for writer in 0..8 {
                let (path, text) = (&path, all(writer));
                scope.spawn(move || (0..100).for_each(|_| write(path, &text).unwrap()));
            }
        });
        let text = fs::read_to_string(&path).unwrap();
        assert!((0..8).any(|writer| text == all(writer)), "{text}");
        assert_eq!(names(folder.path()), ["results.csv"]);
    }

    #[test]
    fn a_draft_that_is_given_up_leaves_nothing() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("summary.json");
        drop(Draft::create(&path).unwrap());
        assert!(names(folder.path()).is_empty());
        fs::create_dir(&path).unwrap();
        let refused = write(&path, "a file").unwrap_err().to_string();
        assert!(
            refused.contains("cannot write") && refused.contains("summary.json:"),
            "{refused}"
        );
        assert_eq!(names(folder.path()), ["summary.json"]);
    }
}
