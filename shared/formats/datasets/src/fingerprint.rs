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
    /// Size of all images, bytes.
    pub bytes: u64,
    /// Time of the first scan, ns since 1970.
    pub first_stamp_ns: Option<i64>,
    /// Time of the last scan, ns since 1970.
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
            let size = match fs::metadata(path) {
                Ok(file) => file.len(),
                Err(source) => {
                    return Err(OpenError::Io {
                        path: path.to_owned(),
                        source,
                    });
                }
            };
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
        if self.format != now.format {
            return Some(format!(
                "its format was {} and is now {}",
                self.format, now.format
            ));
        }
        if self.scans != now.scans {
            return Some(format!(
                "it had {} scans and now has {}",
                self.scans, now.scans
            ));
        }
        for (which, begun, now) in [
            ("first", self.first_stamp_ns, now.first_stamp_ns),
            ("last", self.last_stamp_ns, now.last_stamp_ns),
        ] {
            if begun != now {
                let (begun, now) = (stamp(begun), stamp(now));
                return Some(format!(
                    "the time of its {which} scan was {begun} and is now {now}"
                ));
            }
        }
        if self.bytes != now.bytes {
            return Some(format!(
                "its images had {} bytes and now have {}",
                self.bytes, now.bytes
            ));
        }
        (self.sha256 != now.sha256)
            .then(|| "the names, sizes or times of some of its scans are others".to_owned())
    }
}
