//! The identity of a recording, computed without decoding it.

use std::fs;

use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};

use crate::dataset::{Dataset, Format, OpenError};

/// The identity of a recording: its files by name and size, and its times.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Fingerprint {
    pub format: Format,
    pub scans: usize,
    pub bytes: u64,
    pub first_stamp_ns: Option<i64>,
    pub last_stamp_ns: Option<i64>,
    /// SHA-256 of the name, size and time of each scan.
    pub sha256: String,
}

impl Fingerprint {
    /// Takes the fingerprint of a recording on disk. Images are not read.
    pub fn of(dataset: &dyn Dataset) -> Result<Self, OpenError> {
        let (mut digest, mut bytes) = (Sha256::new(), 0);
        for index in 0..dataset.len() {
            let path = dataset.file(index);
            let file = fs::metadata(path).map_err(|source| OpenError::io(path, source))?;
            let size = file.len();
            let name = path.file_name().unwrap_or_default().as_encoded_bytes();
            let stamp_ns = dataset.nominal_stamp_ns(index).unwrap_or(i64::MIN);
            digest.update((name.len() as u64).to_le_bytes());
            digest.update(name);
            digest.update(size.to_le_bytes());
            digest.update(stamp_ns.to_le_bytes());
            bytes += size;
        }
        let last = dataset.len().checked_sub(1);
        Ok(Self {
            format: dataset.format(),
            scans: dataset.len(),
            bytes,
            first_stamp_ns: dataset.nominal_stamp_ns(0),
            last_stamp_ns: last.and_then(|last| dataset.nominal_stamp_ns(last)),
            sha256: format!("{:x}", digest.finalize()),
        })
    }

    /// Returns how `now` differs: one clause with the earlier and the present value. `None`: it
    /// does not.
    pub fn difference(&self, now: &Self) -> Option<String> {
        let stamp = |ns: Option<i64>| ns.map_or("unknown".to_owned(), |ns| ns.to_string());
        let first = [self, now].map(|it| stamp(it.first_stamp_ns));
        let last = [self, now].map(|it| stamp(it.last_stamp_ns));
        let texts = |value: fn(&Self) -> String| [self, now].map(value);
        // The text before the earlier value, and between the earlier and the present value.
        for ([was, now], [before, between]) in [
            (
                texts(|it| it.format.to_string()),
                ["its format was ", " and is now "],
            ),
            (
                texts(|it| it.scans.to_string()),
                ["it had ", " scans and now has "],
            ),
            (first, ["the time of its first scan was ", " and is now "]),
            (last, ["the time of its last scan was ", " and is now "]),
            (
                texts(|it| it.bytes.to_string()),
                ["its images had ", " bytes and now have "],
            ),
        ] {
            if was != now {
                return Some(format!("{before}{was}{between}{now}"));
            }
        }
        (self.sha256 != now.sha256)
            .then(|| "the names, sizes or times of some of its scans are others".to_owned())
    }
}
