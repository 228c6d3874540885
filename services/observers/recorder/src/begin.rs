//! Where a recording begins: a new one, or the next part of one that an earlier recorder of the run
//! has begun.

use std::{
    collections::BTreeMap,
    fs,
    path::{Path, PathBuf},
};

use gyre_recording::{Head, Recording, RecordingError, next_part, parts};
use gyre_stage::{Manifest, StageError, clock};

use crate::{
    RecorderError,
    options::{HEALTH, LOG, Options},
};

/// A recording that is begun, or goes on in its next part.
pub(crate) struct Begun {
    /// The file to write.
    pub path: PathBuf,
    /// The head of the file.
    pub head: Head,
    /// The parts of an earlier recorder of this run.
    pub earlier: Option<EarlierParts>,
}

/// The parts that earlier recorders have written.
pub(crate) struct EarlierParts {
    id: String,
    /// The number after that of the newest message of each topic.
    next: BTreeMap<String, u64>,
}

impl EarlierParts {
    fn read(first: &Path, topics: &[String]) -> Result<Self, RecordingError> {
        let id = Recording::open(&[first.to_owned()])?.head().id.clone();
        let mut next = BTreeMap::new();
        // What is in a part that cannot be read counts as missed.
        for part in parts(first)
            .into_iter()
            .flat_map(|it| Recording::open(&[it]))
        {
            for topic in topics {
                let newest = part.entries(topic).last().map(|entry| entry.seq);
                let after = newest.map_or(0, |newest| newest.saturating_add(1));
                let next: &mut u64 = next.entry(topic.clone()).or_default();
                *next = after.max(*next);
            }
        }
        Ok(Self { id, next })
    }

    /// Returns the first message of a topic that they lack. Recording begins with the first scan,
    /// which waits for the recorder.
    pub fn next_of(&self, topic: &str) -> u64 {
        self.next.get(topic).copied().unwrap_or_default()
    }
}

/// Returns the file to write: the next part where a recorder of this run was there before.
pub(crate) fn begin(
    options: &Options,
    manifest: &Manifest,
    topics: &[String],
) -> Result<Begun, RecorderError> {
    let (path, part) = next_part(&options.to);
    if part > 1 && !options.continues {
        return Err(RecorderError::Exists(options.to.clone()));
    }
    let earlier = (part > 1).then(|| EarlierParts::read(&options.to, topics));
    let earlier = earlier.transpose()?;
    let id = match &earlier {
        None => format!(
            "{}-{}",
            manifest.prefix.trim_matches('_'),
            clock::since_1970_ns()
        ),
        Some(earlier) => earlier.id.clone(),
    };
    let file = manifest.root.join("config.toml");
    let configuration =
        fs::read_to_string(&file).map_err(|source| StageError::File { path: file, source })?;
    let head = Head {
        id,
        part,
        configuration,
        topics: topics
            .iter()
            .filter(|topic| *topic != LOG && *topic != HEALTH)
            .cloned()
            .collect(),
        scan_bytes: manifest.limits.scan_bytes,
        mode: if manifest.live { "live" } else { "lossless" }.to_owned(),
    };
    Ok(Begun {
        path,
        head,
        earlier,
    })
}
