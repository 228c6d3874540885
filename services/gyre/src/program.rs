//! The programs of a run: this build of Gyre, and what replaces its stages.
//!
//! A stage that is started again must be the program that it was. Gyre's own stages are started from the file that the
//! supervisor executes, which stays while it runs, even if another build takes its name.

use std::{
    collections::BTreeMap,
    env,
    fs::File,
    io, iter,
    path::{Path, PathBuf},
};

use gyre_stage::supervise::{Program, StagePlan};
use sha2::{Digest, Sha256};

/// Returns a path that leads to the program that this process executes, for this process and its children.
pub fn own() -> PathBuf {
    PathBuf::from(format!("/proc/{}/exe", std::process::id()))
}

/// Returns the SHA-256 of a file.
///
/// # Errors
/// A file that cannot be read.
pub fn sha256(path: &Path) -> io::Result<String> {
    let mut digest = Sha256::new();
    io::copy(&mut File::open(path)?, &mut digest)?;
    Ok(format!("{:x}", digest.finalize()))
}

/// Returns the files that a command names: its program, and scripts among its arguments.
pub fn files_of(command: &[String]) -> Vec<PathBuf> {
    let Some((program, arguments)) = command.split_first() else {
        return Vec::new();
    };
    let scripts = arguments.iter().map(PathBuf::from);
    iter::once(found(program))
        .chain(scripts)
        .filter(|path| path.is_file())
        .collect()
}

/// The place of a program that is named without one.
fn found(program: &str) -> PathBuf {
    let folders = env::var_os("PATH").unwrap_or_default();
    let place = env::split_paths(&folders)
        .map(|folder| folder.join(program))
        .find(|path| !program.contains('/') && path.is_file());
    place.unwrap_or_else(|| PathBuf::from(program))
}

/// Returns the SHA-256 of the words of each replaced stage's command and of the files that it names.
///
/// # Errors
/// A file that cannot be read.
pub fn replacements(stages: &[StagePlan]) -> io::Result<BTreeMap<String, String>> {
    let replaced = stages.iter().filter(|stage| !stage.programs.is_empty());
    let digest = |stage: &StagePlan| -> io::Result<(String, String)> {
        let mut digest = Sha256::new();
        for word in &stage.command {
            digest.update((word.len() as u64).to_le_bytes());
            digest.update(word);
        }
        for program in &stage.programs {
            digest.update(sha256(program.path())?);
        }
        Ok((stage.name.clone(), format!("{:x}", digest.finalize())))
    };
    replaced.map(digest).collect()
}

/// Returns the files of a command as they are now. One that is missing is reported when the command is started.
pub fn pinned(command: &[String]) -> Vec<Program> {
    let files = files_of(command).into_iter();
    files.filter_map(|path| Program::at(&path).ok()).collect()
}
