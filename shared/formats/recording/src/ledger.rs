//! The ledger of a recording: the information for the next recorder of its run, even if the earlier
//! parts have been moved away. It is kept with the journal of the run, and read instead of the
//! parts.

use std::{
    io,
    path::{Path, PathBuf},
};

use gyre_storage::SETTINGS;
use serde::{Deserialize, Serialize};

use crate::{
    Head, Positions, RecordingError,
    head::{head, newest},
    parts::{part, parts},
};

/// The newest part of a recording, and what all parts before it hold.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Begun {
    to: PathBuf,
    pub id: String,
    pub part: usize,
    /// The positions behind the parts before it.
    pub positions: Positions,
}

#[derive(Clone, Debug)]
pub struct Ledger(PathBuf);

impl Ledger {
    pub fn of(out: &Path) -> Self {
        Self(out.join("journal").join("recording.toml"))
    }

    pub fn path(&self) -> &Path {
        &self.0
    }

    /// Reads the ledger of an earlier recorder that writes to `to`, with the positions behind its
    /// newest part. Unreadable content of a part counts as missed.
    pub fn read(&self, to: &Path) -> Result<Option<Begun>, RecordingError> {
        let text = match gyre_storage::read_text(&self.0, SETTINGS) {
            Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(None),
            read => read.map_err(|source| self.failed(source))?,
        };
        let mut begun: Begun = toml::from_str(&text)
            .map_err(|error| self.failed(io::Error::other(error.message().to_owned())))?;
        let is_of_it = |path: PathBuf| head(&path).is_some_and(|head| head.id == begun.id);
        // Under another name too: on a disk that is mounted elsewhere, by a link.
        if begun.to != self.absolute(to)? && !parts(to).into_iter().any(is_of_it) {
            return Ok(None);
        }
        if let Ok((head, passed)) = newest(&part(to, begun.part))
            && head.id == begun.id
        {
            for (topic, position) in passed {
                let known = begun.positions.entry(topic).or_default();
                if (position.generation, position.next) > (known.generation, known.next) {
                    *known = position;
                }
            }
        }
        Ok(Some(begun))
    }

    /// Notes that a part is begun. The note survives a power failure.
    pub(crate) fn note(
        &self,
        to: &Path,
        head: &Head,
        positions: &Positions,
    ) -> Result<(), RecordingError> {
        let begun = Begun {
            to: self.absolute(to)?,
            id: head.id.clone(),
            part: head.part,
            positions: positions.clone(),
        };
        let text = toml::to_string(&begun).map_err(|error| self.failed(io::Error::other(error)))?;
        let folder = self.0.parent().map_or(Ok(()), gyre_storage::create_folder);
        let written = folder.and_then(|()| gyre_storage::write(&self.0, text));
        written.map_err(|error| self.failed(error.source))
    }

    /// Returns the absolute path, so that the run may restart in any folder.
    fn absolute(&self, to: &Path) -> Result<PathBuf, RecordingError> {
        std::path::absolute(to).map_err(|source| self.failed(source))
    }

    fn failed(&self, source: io::Error) -> RecordingError {
        RecordingError::io(&self.0, source)
    }
}
