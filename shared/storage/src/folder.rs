//! Folders: the names of files.

use std::{fs, io, os::unix::fs::PermissionsExt, path::Path};

use crate::StorageError;
#[cfg(feature = "record")]
use crate::record::{self, Operation};

/// Makes the names in a folder survive a power failure: the names of its new, renamed and removed
/// files. An empty path, as above a bare name, is the current folder.
pub fn sync_folder(folder: &Path) -> Result<(), StorageError> {
    let folder = match folder.as_os_str().is_empty() {
        true => Path::new("."),
        false => folder,
    };
    fs::File::open(folder)
        .and_then(|handle| handle.sync_all())
        .map_err(StorageError::at("synchronise", folder))?;
    #[cfg(feature = "record")]
    record::push(folder, || Operation::SyncFolder(folder.to_owned()));
    Ok(())
}

/// Creates a folder and those above it, unless they exist. The names survive a power failure.
pub fn create_folder(folder: &Path) -> Result<(), StorageError> {
    if folder.is_dir() {
        return Ok(());
    }
    let above = folder.parent().unwrap_or(Path::new(""));
    if !above.as_os_str().is_empty() {
        create_folder(above)?;
    }
    match fs::create_dir(folder).and_then(|()| open_to_owner(folder)) {
        Err(error) if error.kind() != io::ErrorKind::AlreadyExists => {
            Err(StorageError::at("write", folder)(error))
        }
        _ => {
            #[cfg(feature = "record")]
            record::push(folder, || Operation::CreateFolder(folder.to_owned()));
            sync_folder(above)
        }
    }
}

/// Gives the owner all rights in a new folder. The umask may have taken one: another thread of this
/// process can have changed it for a moment.
fn open_to_owner(folder: &Path) -> io::Result<()> {
    let mode = fs::metadata(folder)?.permissions().mode();
    match mode & 0o700 == 0o700 {
        true => Ok(()),
        false => fs::set_permissions(folder, fs::Permissions::from_mode(mode | 0o700)),
    }
}

/// Removes a file, if there is one. [`sync_folder`] makes that survive a power failure.
pub fn remove(path: &Path) -> Result<(), StorageError> {
    match fs::remove_file(path) {
        Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(()),
        result => result.map_err(StorageError::at("remove", path))?,
    }
    #[cfg(feature = "record")]
    record::push(path, || Operation::Remove(path.to_owned()));
    Ok(())
}

/// Gives a file or a folder another name in the same file system. [`sync_folder`] makes that
/// survive a power failure. False: there is nothing of that name.
pub fn rename(from: &Path, to: &Path) -> Result<bool, StorageError> {
    match fs::rename(from, to) {
        Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(false),
        result => result.map_err(StorageError::at("rename", from))?,
    }
    #[cfg(feature = "record")]
    record::push(from, || Operation::Rename {
        from: from.to_owned(),
        to: to.to_owned(),
    });
    Ok(true)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_folder_of_a_bare_name_is_the_current_one() {
        assert!(sync_folder(Path::new("")).is_ok());
    }
}
