//! The programs of a run: this build of Gyre, and what replaces its stages.
//!
//! A stage that is started again must be the program that it was. Gyre's own stages are started
//! from the file that the supervisor executes, which stays while it runs, even if another build
//! takes its name.

use std::{
    collections::BTreeMap,
    fs::File,
    io,
    path::{Path, PathBuf},
};

use gyre_supervise::StagePlan;
use sha2::{Digest, Sha256};

use crate::Failure;

/// Returns a path that leads to the program that this process executes, for this process and its
/// children.
pub fn own() -> PathBuf {
    PathBuf::from(format!("/proc/{}/exe", std::process::id()))
}

/// Returns the program and the arguments of a `--command`, as a shell would part them.
///
/// # Errors
/// No program, or a quote that is not closed.
pub fn words(command: &str) -> Result<Vec<String>, Failure> {
    match shlex::split(command) {
        Some(words) if !words.is_empty() => Ok(words),
        _ => Err(format!("--command is `{command}`, but must be a program and its arguments, with its quotes closed").into()),
    }
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

/// Returns the SHA-256 of the words of each replaced stage's command and of the files that it
/// names.
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
