//! The programs of a run: this build of Gyre, and what replaces its stages.
//!
//! A stage that is started again must be the program that it was. Gyre's own stages are started
//! from the file that the supervisor executes, which stays while it runs, even if another build
//! takes its name.

use std::{collections::BTreeMap, io, path::Path};

use blake3::Hasher;
use gyre_configuration::{Configuration, terminal::own};
use gyre_contract::run::StageConfig;
use gyre_results::Programs;
use gyre_supervise::StagePlan;

use crate::plan::stage_plans;

pub fn digest(path: &Path) -> io::Result<String> {
    let mut digest = Hasher::new();
    digest.update_reader(gyre_storage::open(path)?)?;
    Ok(digest.finalize().to_string())
}

/// Returns the BLAKE3 digest of what replaces each stage: of its words and the files that it names.
pub fn replaced(configuration: &Configuration) -> io::Result<BTreeMap<String, String>> {
    let stages = stage_plans(configuration, &own());
    let replaced = stages.iter().filter(|stage| !stage.programs.is_empty());
    let of = |stage: &StagePlan| -> io::Result<(String, String)> {
        let mut both = Hasher::new();
        let replacement = configuration.stages.get(&stage.name);
        for word in replacement.map_or_else(Vec::new, StageConfig::replacement) {
            both.update(&(word.len() as u64).to_le_bytes());
            both.update(word.as_bytes());
        }
        for program in &stage.programs {
            both.update(digest(program.path())?.as_bytes());
        }
        Ok((stage.name.clone(), both.finalize().to_string()))
    };
    replaced.map(of).collect()
}

pub fn now(configuration: &Configuration) -> io::Result<Programs> {
    Ok(Programs::new(digest(&own())?, replaced(configuration)?))
}
