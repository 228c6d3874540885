//! Files of limited size. A file from elsewhere may be made to exhaust the memory, or be a link to
//! a device that never ends.

use std::{
    fs::File,
    io::{self, Read},
    path::Path,
};

/// The largest file of settings, bytes.
pub const SETTINGS: u64 = 16 << 20;

/// Reads a text of at most `limit` bytes.
///
/// # Errors
/// A file that cannot be read, is larger, or is not UTF-8.
pub fn read_text(path: &Path, limit: u64) -> io::Result<String> {
    let bytes = read_bytes(path, limit)?;
    String::from_utf8(bytes)
        .map_err(|_| io::Error::new(io::ErrorKind::InvalidData, "it is not UTF-8"))
}

/// Reads a file of at most `limit` bytes.
///
/// # Errors
/// A file that cannot be read, or is larger.
pub fn read_bytes(path: &Path, limit: u64) -> io::Result<Vec<u8>> {
    let file = File::open(path)?;
    let too_large = || {
        let reason = format!("it is larger than {} MB", limit >> 20);
        io::Error::new(io::ErrorKind::FileTooLarge, reason)
    };
    // Known at once of a file, and only at the end of a device or a pipe.
    if file.metadata()?.len() > limit {
        return Err(too_large());
    }
    let mut bytes = Vec::new();
    file.take(limit + 1).read_to_end(&mut bytes)?;
    match bytes.len() as u64 > limit {
        true => Err(too_large()),
        false => Ok(bytes),
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use std::fs;

    use super::*;

    #[test]
    fn a_file_up_to_the_limit_is_read_and_a_larger_one_refused() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("text");
        let limit = 1 << 20;
        fs::write(&file, vec![b'a'; limit]).unwrap();
        assert_eq!(read_text(&file, limit as u64).unwrap().len(), limit);
        fs::write(&file, vec![b'a'; limit + 1]).unwrap();
        let error = read_text(&file, limit as u64).unwrap_err().to_string();
        assert_eq!(error, "it is larger than 1 MB");
        let error = read_bytes(Path::new("/dev/zero"), limit as u64).unwrap_err();
        assert_eq!(error.kind(), io::ErrorKind::FileTooLarge);
        fs::write(&file, [0xff]).unwrap();
        let error = read_text(&file, limit as u64).unwrap_err().to_string();
        assert_eq!(error, "it is not UTF-8");
    }
}
