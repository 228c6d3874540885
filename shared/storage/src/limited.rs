//! Files that may come from elsewhere. One may be made to exhaust the memory, or be a pipe or a
//! device, which never ends or never begins.

use std::{
    fs::{File, OpenOptions},
    io::{self, Read},
    os::unix::fs::{FileTypeExt, OpenOptionsExt},
    path::Path,
};

use rustix::fs::OFlags;

/// The largest file of settings, bytes.
pub const SETTINGS: u64 = 16 << 20;

/// The mark that editors and spreadsheets of Windows put before UTF-8.
const MARK: &str = "\u{feff}";
/// The marks before UTF-16, of both byte orders.
const UTF_16: [&[u8]; 2] = [&[0xff, 0xfe], &[0xfe, 0xff]];

pub fn open(path: &Path) -> io::Result<File> {
    // Without waiting: a pipe that nobody writes to would never be opened.
    let file = OpenOptions::new()
        .read(true)
        .custom_flags(OFlags::NONBLOCK.bits() as i32)
        .open(path)?;
    let kind = file.metadata()?.file_type();
    let name = match kind.is_file() {
        true => return Ok(file),
        false if kind.is_dir() => "a folder",
        false if kind.is_fifo() => "a pipe",
        false => "a device",
    };
    let reason = format!("it is {name}, not a file");
    Err(io::Error::new(io::ErrorKind::InvalidInput, reason))
}

/// Reads a text of at most `limit` bytes, without a byte order mark before it.
pub fn read_text(path: &Path, limit: u64) -> io::Result<String> {
    let bytes = read_bytes(path, limit)?;
    let mut text = String::from_utf8(bytes).map_err(|error| {
        let is_utf_16 = UTF_16.iter().any(|mark| error.as_bytes().starts_with(mark));
        let reason = match is_utf_16 {
            true => "it is UTF-16: save it as UTF-8",
            false => "it is not UTF-8",
        };
        io::Error::new(io::ErrorKind::InvalidData, reason)
    })?;
    if text.starts_with(MARK) {
        text.drain(..MARK.len());
    }
    Ok(text)
}

pub fn read_bytes(path: &Path, limit: u64) -> io::Result<Vec<u8>> {
    let file = open(path)?;
    let too_large = || {
        let reason = format!("it is larger than {} MB", limit >> 20);
        io::Error::new(io::ErrorKind::FileTooLarge, reason)
    };
    // Known at once, but of a file that grows, or one of the system, which claims to be empty.
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
        let error = read_bytes(Path::new("/proc/self/maps"), 1).unwrap_err();
        assert_eq!(error.kind(), io::ErrorKind::FileTooLarge);
        fs::write(&file, [0xff]).unwrap();
        let error = read_text(&file, limit as u64).unwrap_err().to_string();
        assert_eq!(error, "it is not UTF-8");
        for mark in UTF_16 {
            fs::write(&file, [mark, b"a\0"].concat()).unwrap();
            let error = read_text(&file, limit as u64).unwrap_err().to_string();
            assert_eq!(error, "it is UTF-16: save it as UTF-8");
        }
    }

    #[test]
    fn a_byte_order_mark_is_no_part_of_the_text() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("text");
        for (written, read) in [
            ("\u{feff}a\u{feff}", "a\u{feff}"),
            ("\u{feff}", ""),
            ("a", "a"),
        ] {
            fs::write(&file, written).unwrap();
            assert_eq!(read_text(&file, SETTINGS).unwrap(), read);
        }
    }
}
