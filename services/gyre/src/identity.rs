//! `journal/run.toml`: what the run was begun with. A run is resumed only with the same.

use std::{fs, io, path::Path};

use gyre_storage as storage;
use serde::{Deserialize, Serialize};

use crate::{Failure, configuration::Configuration, out::Out};

/// The file, in the folder of the results.
const FILE: &str = "journal/run.toml";
const HEAD: &str = "# What the run was begun with, which the same command compares before it resumes the run.\n# CRC-32 of the rest: ";

/// What a run was begun with.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Identity {
    /// Scans to play.
    pub scans: usize,
    /// The resolved configuration.
    pub configuration: toml::Table,
}

impl Identity {
    /// The identity of a run that begins now.
    ///
    /// # Errors
    /// A configuration that TOML cannot hold.
    pub fn of(configuration: &Configuration, scans: usize) -> Result<Self, Failure> {
        Ok(Self {
            scans,
            configuration: configuration.to_toml()?.parse()?,
        })
    }

    /// Writes it, once for a run. It survives a power failure when this returns.
    ///
    /// # Errors
    /// A file that cannot be written.
    pub fn write(&self, out: &Out) -> Result<(), Failure> {
        let text = toml::to_string_pretty(self)?;
        let checksum = checksum(&text);
        Ok(storage::write(
            &out.join(FILE),
            format!("{HEAD}{checksum}\n{text}"),
        )?)
    }

    /// Reads that of the run whose journal holds `poses` poses.
    ///
    /// # Errors
    /// One sentence that says what is wrong with the file. It is written as a whole before the first pose, so the run did not
    /// leave it like that.
    pub fn read(out: &Out, poses: u64) -> Result<Self, Failure> {
        let path = out.join(FILE);
        Self::read_file(&path).map_err(|state| {
            format!(
                "{} {state}: it says what the {poses} poses in the journal beside it were computed from, so the run cannot be resumed \
                 without it; restore it from a backup, or choose another --out (--fresh would discard the poses)",
                path.display()
            )
            .into()
        })
    }

    fn read_file(path: &Path) -> Result<Self, String> {
        let text = fs::read_to_string(path).map_err(|error| match error.kind() {
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

    /// Checks that this configuration continues the run.
    ///
    /// # Errors
    /// One sentence that names a key that differs.
    pub fn require(
        &self,
        configuration: &Configuration,
        out: &Path,
        poses: u64,
    ) -> Result<(), Failure> {
        match configuration.difference(&self.configuration)? {
            None => Ok(()),
            Some(difference) => Err(format!(
                "{} holds an unfinished run of another configuration ({poses} poses; {difference}): choose another --out, \
                 or discard it with --fresh",
                out.display()
            )
            .into()),
        }
    }
}

fn checksum(text: &str) -> String {
    format!("{:08x}", crc32fast::hash(text.as_bytes()))
}
