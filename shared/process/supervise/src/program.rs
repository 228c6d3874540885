//! The files that a command executes, which must not change during the run.

use std::{
    fs, io, iter,
    os::unix::fs::MetadataExt,
    path::{Path, PathBuf},
};

use gyre_client::control::place_of_program;

/// A file that a command executes, as it was when the run was begun or resumed.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Program {
    path: PathBuf,
    state: State,
}

/// The metadata that changes with a file's content: device, inode, size, and time of change, s and
/// ns.
type State = (u64, u64, u64, i64, i64);

fn state_of(path: &Path) -> io::Result<State> {
    let it = fs::metadata(path)?;
    Ok((it.dev(), it.ino(), it.size(), it.mtime(), it.mtime_nsec()))
}

impl Program {
    pub fn at(path: &Path) -> io::Result<Self> {
        Ok(Self {
            path: path.to_owned(),
            state: state_of(path)?,
        })
    }

    /// Returns the files of a command in their present state; the command starts in `directory`, or
    /// in the directory of this process. A file that is missing is reported when the command is
    /// started.
    pub fn all_of(command: &[String], directory: Option<&Path>) -> Vec<Self> {
        let files = files_of(command, directory.unwrap_or(Path::new(""))).into_iter();
        files.filter_map(|path| Self::at(&path).ok()).collect()
    }

    pub fn path(&self) -> &Path {
        &self.path
    }

    pub(crate) fn is_unchanged(&self) -> bool {
        state_of(&self.path).is_ok_and(|state| state == self.state)
    }
}

/// Returns the files that a command names: its program, and scripts among its arguments.
fn files_of(command: &[String], directory: &Path) -> Vec<PathBuf> {
    let Some((program, arguments)) = command.split_first() else {
        return Vec::new();
    };
    let scripts = arguments.iter().map(PathBuf::from);
    iter::once(place_of_program(program))
        .chain(scripts)
        .map(|path| directory.join(path))
        .filter(|path| path.is_file())
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_script_is_looked_for_where_the_command_is_started() {
        let folder = tempfile::tempdir().unwrap();
        fs::write(folder.path().join("stage.py"), "one").unwrap();
        let command = ["sh", "stage.py"].map(str::to_owned);
        let of = |directory| Program::all_of(&command, directory);
        assert_eq!((of(None).len(), of(Some(folder.path())).len()), (1, 2));
    }

    #[test]
    fn a_file_that_is_replaced_changed_or_removed_is_noticed() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("stage.sh");
        fs::write(&path, "one").unwrap();
        let program = Program::at(&path).unwrap();
        assert!(program.is_unchanged());
        let other = folder.path().join("other.sh");
        fs::write(&other, "two").unwrap();
        fs::rename(&other, &path).unwrap();
        assert!(
            !program.is_unchanged(),
            "replaced by another of the same size"
        );
        let program = Program::at(&path).unwrap();
        fs::write(&path, "three").unwrap();
        assert!(!program.is_unchanged());
        fs::remove_file(&path).unwrap();
        assert!(!program.is_unchanged());
    }
}
