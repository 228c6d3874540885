//! Counts of the deliveries and losses of a sensor, in a file of the run's root: a source that
//! replaces a dead one continues to count, and observers see the counts while the run works.

use std::{
    fs::{File, OpenOptions},
    os::unix::fs::{FileExt, OpenOptionsExt},
    path::PathBuf,
};

use serde::{Deserialize, Serialize};

use crate::{Manifest, StageCounters, StageError};

/// The name of the file: the numbers of [`Received`] in their order, each as eight bytes,
/// little-endian.
const FILE: &str = "source.received";
const NUMBERS: usize = 9;
const BYTES: usize = 8 * NUMBERS;

/// Counts of the deliveries and losses of a live sensor since the start of the run.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Received {
    /// Azimuths that are missing from the scans that were published.
    pub missing_azimuths: u64,
    /// Turns of the sensor without a scan.
    pub scans_left_out: u64,
    /// Messages that could not be read.
    pub damaged_messages: u64,
    /// Datagrams of others, and descriptions of scans that do not fit into the run. They were
    /// passed over.
    pub foreign_messages: u64,
    pub connections: u64,
    pub is_receiving: bool,
    /// The scan that was published last.
    pub last_scan: Option<LastScan>,
}

/// A scan that was published.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct LastScan {
    /// Time of its middle by the sensor, ns.
    pub stamp_ns: i64,
    /// When its last azimuth was read, `CLOCK_MONOTONIC`, ns.
    pub at_ns: i64,
}

impl Received {
    /// Returns the number of connections after the first.
    #[must_use]
    pub fn reconnections(&self) -> u64 {
        self.connections.saturating_sub(1)
    }

    /// Sets the counts of the source.
    pub(super) fn count(&self, counters: &mut StageCounters) {
        counters.missing_azimuths = self.missing_azimuths;
        counters.scans_left_out = self.scans_left_out;
        counters.damaged_messages = self.damaged_messages;
        counters.foreign_messages = self.foreign_messages;
        counters.reconnections = self.reconnections();
    }

    fn to_bytes(self) -> [u8; BYTES] {
        let scan = self.last_scan.unwrap_or(LastScan {
            stamp_ns: 0,
            at_ns: 0,
        });
        let numbers: [u64; NUMBERS] = [
            self.missing_azimuths,
            self.scans_left_out,
            self.damaged_messages,
            self.foreign_messages,
            self.connections,
            self.is_receiving.into(),
            self.last_scan.is_some().into(),
            scan.stamp_ns as u64,
            scan.at_ns as u64,
        ];
        let mut bytes = [0; BYTES];
        for (k, number) in numbers.into_iter().enumerate() {
            bytes[8 * k..][..8].copy_from_slice(&number.to_le_bytes());
        }
        bytes
    }

    fn from_bytes(bytes: &[u8; BYTES]) -> Self {
        let number = |k: usize| {
            let mut number = [0; 8];
            number.copy_from_slice(&bytes[8 * k..][..8]);
            u64::from_le_bytes(number)
        };
        let scan = LastScan {
            stamp_ns: number(7) as i64,
            at_ns: number(8) as i64,
        };
        Self {
            missing_azimuths: number(0),
            scans_left_out: number(1),
            damaged_messages: number(2),
            foreign_messages: number(3),
            connections: number(4),
            is_receiving: number(5) != 0,
            last_scan: (number(6) != 0).then_some(scan),
        }
    }
}

/// Returns the deliveries of a run's sensor; `None` if its source is no sensor.
pub fn read(manifest: &Manifest) -> Option<Received> {
    let mut bytes = [0; BYTES];
    let file = File::open(manifest.root.join(FILE)).ok()?;
    file.read_exact_at(&mut bytes, 0).ok()?;
    Some(Received::from_bytes(&bytes))
}

pub(super) struct ReceivedWriter {
    path: PathBuf,
    file: File,
    written: Option<Received>,
}

impl ReceivedWriter {
    pub fn open(manifest: &Manifest) -> Result<Self, StageError> {
        let path = manifest.root.join(FILE);
        let mut options = OpenOptions::new();
        options.create(true).truncate(false).write(true).mode(0o600);
        match options.open(&path) {
            Ok(file) => Ok(Self {
                path,
                file,
                written: None,
            }),
            Err(source) => Err(StageError::File { path, source }),
        }
    }

    /// Writes the numbers, if they are others than before.
    pub fn write(&mut self, received: Received) -> Result<(), StageError> {
        if self.written == Some(received) {
            return Ok(());
        }
        let written = self.file.write_all_at(&received.to_bytes(), 0);
        written.map_err(|source| StageError::File {
            path: self.path.clone(),
            source,
        })?;
        self.written = Some(received);
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_received_is_read_as_it_was_written() {
        let received = Received {
            missing_azimuths: 1,
            scans_left_out: 2,
            damaged_messages: 3,
            foreign_messages: 4,
            connections: u64::MAX,
            is_receiving: true,
            last_scan: Some(LastScan {
                stamp_ns: -7,
                at_ns: i64::MAX,
            }),
        };
        for received in [received, Received::default()] {
            assert_eq!(Received::from_bytes(&received.to_bytes()), received);
        }
    }
}
