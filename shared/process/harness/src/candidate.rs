//! A program that stands in for a stage.

use std::path::PathBuf;

use gyre_messages::StageId;
use gyre_stage::{Manifest, StageError, wake::Signals};
use gyre_supervise::{Scheduling, SuperviseError, rig::Rig};

use crate::StageTopics;

/// A program that stands in for a stage, and the run that it sees.
#[derive(Clone, Debug)]
pub struct Candidate {
    /// The stage that it replaces.
    pub stage: StageId,
    /// The program and its arguments.
    pub command: Vec<String>,
    /// The priority of its process.
    pub scheduling: Scheduling,
    /// The program `gyre`: the guardian, and Gyre's own stages.
    pub gyre: String,
    /// The manifest of the run, without prefix and root.
    pub manifest: Manifest,
    /// The configuration of the run, TOML.
    pub configuration: String,
}

impl Candidate {
    /// Returns the topics of the stage.
    pub fn topics(&self) -> StageTopics {
        StageTopics::of(self.stage, &self.manifest)
    }

    /// Returns the command of Gyre's own stage.
    pub fn own_command(&self, stage: StageId) -> Vec<String> {
        vec![
            self.gyre.clone(),
            "stage".to_owned(),
            stage.name().to_owned(),
        ]
    }

    /// Creates a run that writes to `out`, and its services.
    ///
    /// # Errors
    /// A folder or a service cannot be created.
    pub fn rig<'a>(&self, out: PathBuf, signals: &'a Signals) -> Result<Rig<'a>, SuperviseError> {
        let manifest = self.manifest_in(out)?;
        Rig::new(manifest, &self.configuration, &self.guardian(), signals)
    }

    /// Creates a run that writes to `out`, without any service.
    ///
    /// # Errors
    /// A folder cannot be created.
    pub fn empty_rig<'a>(
        &self,
        out: PathBuf,
        signals: &'a Signals,
    ) -> Result<Rig<'a>, SuperviseError> {
        let manifest = self.manifest_in(out)?;
        Rig::without_services(manifest, &self.configuration, &self.guardian(), signals)
    }

    fn guardian(&self) -> [String; 2] {
        [&self.gyre, "guard"].map(str::to_owned)
    }

    fn manifest_in(&self, out: PathBuf) -> Result<Manifest, StageError> {
        for folder in ["log", "journal"] {
            let path = out.join(folder);
            let created = gyre_storage::create_folder(&path);
            created.map_err(|error| StageError::File {
                path,
                source: error.source,
            })?;
        }
        Ok(Manifest {
            out,
            ..self.manifest.clone()
        })
    }
}
