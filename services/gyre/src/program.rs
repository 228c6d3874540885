//! The programs of a run: this build of Gyre, and what replaces its stages.
//!
//! A stage that is started again must be the program that it was. Gyre's own stages are started
//! from the file that the supervisor executes, which stays while it runs, even if another build
//! takes its name.

use std::{collections::BTreeMap, io, path::Path};

use gyre_configuration::Configuration;
use gyre_results::Programs;
use gyre_run::StageConfig;
use gyre_supervise::StagePlan;
use gyre_terminal::own;
use sha2::{Digest, Sha256};

use crate::plan::stage_plans;

/// Returns the SHA-256 of a file.
///
/// # Errors
/// A file that cannot be read.
pub fn sha256(path: &Path) -> io::Result<String> {
    let mut digest = Sha256::new();
    io::copy(&mut gyre_storage::open(path)?, &mut digest)?;
    Ok(format!("{:x}", digest.finalize()))
}

/// Returns the SHA-256 of the words of what replaces each stage and of the files that it names.
///
/// # Errors
/// A file that cannot be read.
pub fn replaced(configuration: &Configuration) -> io::Result<BTreeMap<String, String>> {
    let stages = stage_plans(configuration, &own());
    let replaced = stages.iter().filter(|stage| !stage.programs.is_empty());
    let digest = |stage: &StagePlan| -> io::Result<(String, String)> {
        let mut digest = Sha256::new();
        let replacement = configuration.stages.get(&stage.name);
        for word in replacement.map_or_else(Vec::new, StageConfig::replacement) {
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

/// Returns the programs of a run that is started now.
///
/// # Errors
/// A program that cannot be read.
pub fn now(configuration: &Configuration) -> io::Result<Programs> {
    Ok(Programs::new(sha256(&own())?, replaced(configuration)?))
}
