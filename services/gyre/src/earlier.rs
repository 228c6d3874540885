//! What an earlier run left in the folder of the results: nothing, a journal to resume, or one whose results are to be written.

use std::{fs, path::PathBuf};

use gyre_messages::flag;
use gyre_pose_integration::journal;
use gyre_refinement::checkpoint;
use gyre_storage as storage;

use crate::{Failure, configuration::Configuration, identity::Identity, out::Out, results};

/// Says that the journal has its end and that all results have been written from it: the next run starts anew.
const COMPLETE: &str = "journal/complete";
const CONFIGURATION: &str = "config.toml";
const LOGS: [&str; 2] = ["log.jsonl", "log.jsonl.old"];

/// What an earlier run left.
#[derive(Debug)]
pub enum Earlier {
    /// Nothing to go on from.
    Nothing,
    /// A journal without its end.
    Unfinished(Begun),
    /// A journal with its end, of which results have not been written.
    Ended(Begun),
}

/// A run that was begun.
#[derive(Debug)]
pub struct Begun {
    /// Poses in its journal.
    pub poses: usize,
    /// What it was begun with.
    pub identity: Identity,
}

impl Earlier {
    /// Looks at the folder and changes nothing. A `fresh` run goes on from nothing.
    ///
    /// # Errors
    /// Files that cannot be read, or a run of another configuration.
    pub fn of(out: &Out, configuration: &Configuration, fresh: bool) -> Result<Self, Failure> {
        let records = journal::read(&journal::path(out.path()))?;
        let ended = records.last().is_some_and(|last| last.item.is(flag::END));
        let poses = records.len() - usize::from(ended);
        if fresh || records.is_empty() || (ended && out.join(COMPLETE).exists()) {
            return Ok(Self::Nothing);
        }
        let identity = Identity::read(out, poses)?;
        identity.require(configuration, out.path(), poses)?;
        let begun = Begun { poses, identity };
        Ok(match ended {
            true => Self::Ended(begun),
            false => Self::Unfinished(begun),
        })
    }
}

/// Removes the results and the state of an earlier run, and says what the new one begins with. The journal goes first: without
/// it nothing else is taken for part of a run.
///
/// # Errors
/// A file that cannot be removed or written.
pub fn begin(out: &Out, identity: &Identity, resolved: &str) -> Result<(), Failure> {
    let folder = out.join("journal");
    storage::create_folder(&folder)?;
    storage::remove(&journal::path(out.path()))?;
    storage::sync_folder(&folder)?;
    let state = [checkpoint::path(out.path()), out.join(COMPLETE)];
    // A new run may not write all of them: none of the earlier ones must be taken for its own.
    let results = results::FILES
        .iter()
        .chain(&LOGS)
        .map(|name| out.join(name));
    state
        .into_iter()
        .chain(results)
        .try_for_each(|path: PathBuf| storage::remove(&path))?;
    identity.write(out)?;
    Ok(storage::write(&out.join(CONFIGURATION), resolved)?)
}

/// Says that all results have been written. They survive a power failure by now.
///
/// # Errors
/// A file that cannot be written.
pub fn mark_complete(out: &Out, poses: usize) -> Result<(), Failure> {
    Ok(storage::write(
        &out.join(COMPLETE),
        format!("poses = {poses}\n"),
    )?)
}

/// Writes `config.toml` again if it is not what the run was begun with: it was lost or damaged meanwhile.
///
/// # Errors
/// A file that cannot be written.
pub fn restore_configuration(out: &Out, identity: &Identity) -> Result<(), Failure> {
    let path = out.join(CONFIGURATION);
    let found = fs::read_to_string(&path).ok();
    let found: Option<toml::Table> = found.and_then(|text| text.parse().ok());
    match found.as_ref() == Some(&identity.configuration) {
        true => Ok(()),
        false => Ok(storage::write(
            &path,
            toml::to_string_pretty(&identity.configuration)?,
        )?),
    }
}
