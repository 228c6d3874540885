//! The manifest of a run, which each of its processes reads.

use std::{
    fs::{self, OpenOptions},
    os::unix::fs::OpenOptionsExt,
    path::{Path, PathBuf},
};

use gyre_contract::{Limits, Message, Refined, Window, topics};
use serde::{Deserialize, Serialize};

use crate::RunError;

/// The properties of a run that its processes need.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub struct Manifest {
    pub prefix: String,
    pub root: PathBuf,
    pub out: PathBuf,
    pub window: Window,
    pub limits: Limits,
    /// True in live mode, which drops old scans; false in lossless mode, which processes every
    /// scan.
    pub live: bool,
    /// True if the run has a refinement: poses are then composed of `refined`, else of `motion`.
    pub refines: bool,
    /// Speed of playback relative to the sensor's clock; `None`: as fast as the window admits
    /// scans.
    pub rate: Option<f64>,
    /// BLAKE3 digest of the supervisor's program, which all stages of its own must be.
    pub build: String,
}

impl Manifest {
    pub fn read(root: &Path) -> Result<Self, RunError> {
        let path = Self::path(root);
        let text = fs::read_to_string(&path).map_err(|error| RunError::manifest(&path, error))?;
        serde_json::from_str(&text).map_err(|error| RunError::manifest(&path, error))
    }

    /// Returns whether the run has this topic.
    pub fn has_topic(&self, name: &str) -> bool {
        let is_known = topics(&self.window).any(|topic| topic.name == name);
        is_known && (self.refines || name != Refined::TOPIC)
    }

    /// Returns the log where all processes append their events.
    pub fn events(&self) -> PathBuf {
        self.out.join("log.jsonl")
    }

    pub fn path(root: &Path) -> PathBuf {
        root.join("manifest.json")
    }

    /// Writes the manifest, the resolved configuration and the configuration of the transport into
    /// the run's root.
    pub fn write(&self, configuration: &str) -> Result<(), RunError> {
        let transport = format!(
            "[global]\nroot-path = \"{}/\"\nprefix = \"{}\"\n\n\
             [global.node]\ncleanup-dead-nodes-on-creation = false\ncleanup-dead-nodes-on-destruction = false\n\n\
             [global.service]\ncleanup-dead-nodes-on-open = false\n",
            self.root.display(),
            self.prefix
        );
        let manifest = serde_json::to_string_pretty(self).map_err(|error| {
            RunError::Input(format!("cannot write the run's manifest: {error}"))
        })?;
        for (name, text) in [
            ("manifest.json", manifest.as_str()),
            ("config.toml", configuration),
            ("iox.toml", &transport),
        ] {
            write(self.root.join(name), text)?;
        }
        Ok(())
    }
}

/// Options for creating a file of a run, which is the owner's alone.
pub fn options() -> OpenOptions {
    let mut options = OpenOptions::new();
    options.create(true).mode(0o600);
    options
}

/// Replaces a file as a whole: if there is no room for it, it stays as it is.
pub fn write(path: PathBuf, text: &str) -> Result<(), RunError> {
    let written = gyre_storage::write(&path, text);
    written.map_err(|error| RunError::file(&path)(error.source))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_file_of_a_run_is_replaced_as_a_whole() {
        let root = tempfile::tempdir().unwrap();
        let [notice, before] = ["notice", "before"].map(|name| root.path().join(name));
        write(notice.clone(), "first").unwrap();
        fs::hard_link(&notice, &before).unwrap();
        write(notice.clone(), "second").unwrap();
        let read = [notice, before].map(|path| fs::read_to_string(path).unwrap());
        assert_eq!(read, ["second", "first"]);
    }
}
