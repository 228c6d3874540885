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
        let values = |of: &Self| {
            [
                of.format.to_string(),
                of.scans.to_string(),
                stamp(of.first_stamp_ns),
                stamp(of.last_stamp_ns),
                of.bytes.to_string(),
                of.sha256.clone(),
            ]
        };
        let (was, is) = (values(self), values(now));
        let other = (0..was.len()).find(|k| was[*k] != is[*k])?;
        let (was, is) = (&was[other], &is[other]);
        Some(match other {
            0 => format!("its format was {was} and is now {is}"),
            1 => format!("it had {was} scans and now has {is}"),
            2 => format!("the time of its first scan was {was} and is now {is}"),
            3 => format!("the time of its last scan was {was} and is now {is}"),
            4 => format!("its images had {was} bytes and now have {is}"),
            _ => "the names, sizes or times of some of its scans are others".to_owned(),
        })
    }
}
