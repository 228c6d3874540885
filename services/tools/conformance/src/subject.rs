//! What is tested, and how patiently.

use std::{fs, io, ops::Range, path::Path, time::Duration};

use gyre_messages::StageId;
use gyre_radar::Dataset;
use gyre_stage::{Manifest, wake::Signals};
use gyre_supervise::rig::Rig;

use crate::{ConformanceError, topology::Ports};

/// Writes files into the root of a run.
pub type Prepare = Box<dyn Fn(&Path) -> io::Result<()>>;

/// A program that is to keep the contract of a stage.
pub struct Subject {
    /// The stage that it replaces.
    pub stage: StageId,
    /// The program and its arguments.
    pub command: Vec<String>,
    /// The program of Gyre's own stages and of the guardian.
    pub gyre: String,
    /// The manifest of the runs that it is tested in, without prefix and root. Results are written below `out`.
    pub manifest: Manifest,
    /// The configuration of the runs, TOML.
    pub configuration: String,
    /// The stages of a run with this configuration.
    pub stages: Vec<StageId>,
    /// What else is written to the root of a run, as the list of a recording's files.
    pub prepare: Prepare,
    /// How it is tested.
    pub demands: Demands,
}

/// How patiently a program is tested, and what else is asked of it.
#[derive(Clone, Debug)]
pub struct Demands {
    /// Time for its start.
    pub start_timeout: Duration,
    /// Time for one item.
    pub patience: Duration,
    /// Time for its exit after SIGTERM, and after an input that it has to refuse.
    pub stop_timeout: Duration,
    /// Time in which a program that is to send nothing is watched.
    pub quiet: Duration,
    /// Whether its results are to be those of Gyre's own stage, to the bit.
    pub same_as_own: bool,
    /// The 99th percentile of its work on an item that is allowed; of fewer than a hundred items the maximum.
    pub budget: Option<Duration>,
}

impl Default for Demands {
    fn default() -> Self {
        Self {
            start_timeout: Duration::from_secs(30),
            patience: Duration::from_secs(10),
            stop_timeout: Duration::from_secs(2),
            quiet: Duration::from_millis(300),
            same_as_own: false,
            budget: None,
        }
    }
}

/// The scans that the inputs are computed from.
pub struct Scans {
    /// An open recording or simulation.
    pub dataset: Box<dyn Dataset>,
    /// The scans to play.
    pub played: Range<usize>,
}

impl Subject {
    /// Returns the command of Gyre's own stage.
    pub(crate) fn own(&self, stage: StageId) -> Vec<String> {
        [&self.gyre, "stage", stage.name()]
            .map(str::to_owned)
            .into()
    }

    /// Returns the topics of the stage.
    pub(crate) fn ports(&self) -> Ports {
        Ports::of(self.stage, &self.manifest)
    }

    /// Creates a run of its own, with its services.
    ///
    /// # Errors
    /// Folders or services that cannot be created.
    pub(crate) fn rig<'a>(
        &self,
        signals: &'a Signals,
        name: &str,
    ) -> Result<Rig<'a>, ConformanceError> {
        let manifest = self.manifest_of(name)?;
        self.prepared(Rig::new(
            manifest,
            &self.configuration,
            &self.guardian(),
            signals,
        )?)
    }

    /// Creates a run of its own without any service.
    ///
    /// # Errors
    /// Folders that cannot be created.
    pub(crate) fn empty_rig<'a>(
        &self,
        signals: &'a Signals,
        name: &str,
    ) -> Result<Rig<'a>, ConformanceError> {
        let manifest = self.manifest_of(name)?;
        self.prepared(Rig::without_services(
            manifest,
            &self.configuration,
            &self.guardian(),
            signals,
        )?)
    }

    /// Writes into the root of a run what else the supervisor writes there.
    fn prepared<'a>(&self, rig: Rig<'a>) -> Result<Rig<'a>, ConformanceError> {
        let path = rig.manifest().root.clone();
        match (self.prepare)(&path) {
            Ok(()) => Ok(rig),
            Err(source) => Err(ConformanceError::File { path, source }),
        }
    }

    /// Returns the command of the guardian.
    fn guardian(&self) -> Vec<String> {
        [&self.gyre, "guard"].map(str::to_owned).into()
    }

    /// Returns the manifest of a run of its own, the folders of which are created.
    ///
    /// # Errors
    /// They cannot be created.
    fn manifest_of(&self, name: &str) -> Result<Manifest, ConformanceError> {
        let out = self.manifest.out.join(name);
        for folder in ["log", "journal"] {
            let path = out.join(folder);
            fs::create_dir_all(&path).map_err(|source| ConformanceError::File { path, source })?;
        }
        Ok(Manifest {
            out,
            ..self.manifest.clone()
        })
    }
}
