//! `journal/run.toml`: the programs, the recording and the configuration at the start of the run. A
//! run is resumed only with the same.

use std::{
    collections::{BTreeMap, BTreeSet},
    io,
    path::Path,
};

use gyre_configuration::{
    Configuration, difference, fingerprint, terminal::Failure, with_stored_options,
};
use gyre_contract::run::BEGUN_WITH;
use gyre_datasets::{DatasetOptions, Fingerprint};
use gyre_storage as storage;
use serde::{Deserialize, Serialize};

use crate::out::Out;

const HEAD: &str = "# What the run was begun with, which the same command compares before it resumes the run.\n# CRC-32 of the rest: ";

#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Identity {
    /// Scans to play; `None`: without end.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub scans: Option<usize>,
    programs: Programs,
    /// The options to read the recording, including its `dataset.toml`.
    dataset: DatasetOptions,
    /// The recording; `None` for a simulation, which its configuration determines.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    recording: Option<Fingerprint>,
    pub configuration: toml::Table,
}

#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Programs {
    version: String,
    pub build: String,
    /// BLAKE3 digest of each replaced stage's command and of the files that it names.
    replaced: BTreeMap<String, String>,
}

impl Programs {
    /// Returns the programs of a run: the BLAKE3 digests of Gyre's program and of each replaced
    /// stage.
    pub fn new(build: String, replaced: BTreeMap<String, String>) -> Self {
        Self {
            version: env!("CARGO_PKG_VERSION").to_owned(),
            build,
            replaced,
        }
    }

    fn difference(&self, now: &Self) -> Option<String> {
        if self.build != now.build {
            let named = |of: &Self| {
                let build = of.build.get(..12).unwrap_or_default();
                format!("build {build} of version {}", of.version)
            };
            let (was, is) = (named(self), named(now));
            return Some(format!("gyre was {was} and is now {is}"));
        }
        let stages: BTreeSet<&String> = self.replaced.keys().chain(now.replaced.keys()).collect();
        let other = |stage: &&String| self.replaced.get(*stage) != now.replaced.get(*stage);
        let stage = stages.into_iter().find(other)?;
        Some(format!("the program of {stage} is another one"))
    }
}

impl Identity {
    pub fn of(
        configuration: &Configuration,
        programs: &Programs,
        dataset: DatasetOptions,
        scans: Option<usize>,
        recording: Option<&Fingerprint>,
    ) -> Result<Self, Failure> {
        Ok(Self {
            scans,
            programs: programs.clone(),
            dataset,
            recording: recording.cloned(),
            configuration: configuration.to_toml()?.parse()?,
        })
    }

    /// Writes it, once for a run. It survives a power failure when this returns.
    pub fn write(&self, out: &Out) -> Result<(), Failure> {
        let text = toml::to_string_pretty(self)?;
        let text = format!("{HEAD}{}\n{text}", checksum(&text));
        Ok(storage::write(&out.join(BEGUN_WITH), text)?)
    }

    pub fn read(out: &Out) -> Result<Self, Failure> {
        let path = out.join(BEGUN_WITH);
        Self::read_file(&path).map_err(|state| {
            let path = path.display();
            format!(
                "{path} {state}: it names the inputs of the run there; restore it from a backup, choose another --out, or \
                 discard the run with --fresh"
            )
            .into()
        })
    }

    fn read_file(path: &Path) -> Result<Self, String> {
        let text =
            storage::read_text(path, storage::SETTINGS).map_err(|error| match error.kind() {
                io::ErrorKind::NotFound => "is missing".to_owned(),
                _ => format!("cannot be read ({error})"),
            })?;
        if text.is_empty() {
            return Err("is empty".to_owned());
        }
        let (found, text) = text
            .strip_prefix(HEAD)
            .and_then(|rest| rest.split_once('\n'))
            .ok_or("is damaged")?;
        // A part of a TOML file is one as well.
        match found == checksum(text) {
            true => toml::from_str(text)
                .map_err(|error| format!("is of another version ({})", error.message())),
            false => Err("is damaged".to_owned()),
        }
    }

    /// Checks that the run was of this configuration and of these programs; the error names the
    /// difference.
    pub fn require(&self, now: &Configuration, programs: &Programs) -> Result<(), Failure> {
        if let Some(difference) = now.difference(&self.configuration)? {
            return Err(format!("another configuration ({difference})").into());
        }
        let difference = self.programs.difference(programs);
        difference.map_or(Ok(()), |it| Err(format!("another program ({it})").into()))
    }

    /// Checks that the recording is the one that the run was begun with, and is read in the same
    /// way; the error names the difference.
    pub fn require_recording(&self, now: &Self) -> Result<(), Failure> {
        let options = |of: &Self| toml::Table::try_from(of.dataset);
        if let Some(difference) = difference::first(&options(self)?, &options(now)?) {
            return Err(format!("another configuration (dataset.{difference})").into());
        }
        let difference = match (&self.recording, &now.recording) {
            (Some(begun), Some(now)) => begun.difference(now),
            _ => None,
        };
        difference.map_or(Ok(()), |it| Err(format!("another recording ({it})").into()))
    }

    /// Returns whether a run of this configuration that begins now would compute the same and judge
    /// it by the same truth, if these are the replaced stages as in [`Programs::new`]. Gyre's own
    /// build may differ.
    pub fn has_inputs_of(
        &self,
        configuration: &Configuration,
        replaced: &BTreeMap<String, String>,
    ) -> Result<bool, Failure> {
        let resolved = with_stored_options(configuration)?;
        let truth = |table: &toml::Table| table.get("run")?.get("ground_truth").cloned();
        let now: toml::Table = configuration.to_toml()?.parse()?;
        Ok(configuration.difference(&self.configuration)?.is_none()
            && truth(&self.configuration) == truth(&now)
            && self.programs.replaced == *replaced
            && self.dataset == resolved.dataset
            && self.recording == fingerprint(&resolved)?)
    }
}

fn checksum(text: &str) -> String {
    format!("{:08x}", crc32fast::hash(text.as_bytes()))
}
