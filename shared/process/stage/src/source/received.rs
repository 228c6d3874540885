//! Counts of the deliveries and losses of a sensor, in a file of the run's root: a source that
//! replaces a dead one continues to count, and observers see the counts while the run works.

use serde::{Deserialize, Serialize};

use crate::{
    Manifest, StageCounters, StageError,
    numbers::{self, Numbers},
};

/// The name of the file: the numbers of [`Received`] in their order.
const FILE: &str = "source.received";

/// Counts of the deliveries and losses of a live sensor since the start of the run.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Received {
    /// Azimuths that are missing from the scans that were published.
    pub missing_azimuths: u64,
    /// Turns of the sensor without a scan.
    pub scans_left_out: u64,
    pub damaged_messages: u64,
    /// Datagrams of others, and descriptions of scans that do not fit into the run. They were
    /// passed over.
    pub foreign_messages: u64,
    pub connections: u64,
    pub is_receiving: bool,
    pub last_scan: Option<LastScan>,
}

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct LastScan {
    /// Time of its middle by the sensor, ns.
    pub stamp_ns: i64,
    /// When its last azimuth was read, `CLOCK_MONOTONIC`, ns.
    pub at_ns: i64,
}

impl Received {
    #[must_use]
    pub fn reconnections(&self) -> u64 {
        self.connections.saturating_sub(1)
    }

    pub(super) fn count(&self, counters: &mut StageCounters) {
        counters.missing_azimuths = self.missing_azimuths;
        counters.scans_left_out = self.scans_left_out;
        counters.damaged_messages = self.damaged_messages;
        counters.foreign_messages = self.foreign_messages;
        counters.reconnections = self.reconnections();
    }

    pub(super) fn to_numbers(self) -> [u64; 9] {
        let scan = self.last_scan.unwrap_or_default();
        [
            self.missing_azimuths,
            self.scans_left_out,
            self.damaged_messages,
            self.foreign_messages,
            self.connections,
            self.is_receiving.into(),
            self.last_scan.is_some().into(),
            scan.stamp_ns as u64,
            scan.at_ns as u64,
        ]
    }

    fn of(numbers: [u64; 9]) -> Self {
        let [missing_azimuths, scans_left_out, damaged_messages, ..] = numbers;
        let [.., foreign_messages, connections, receives, has_scan, _, _] = numbers;
        let [.., stamp_ns, at_ns] = numbers.map(|number| number as i64);
        Self {
            missing_azimuths,
            scans_left_out,
            damaged_messages,
            foreign_messages,
            connections,
            is_receiving: receives != 0,
            last_scan: (has_scan != 0).then_some(LastScan { stamp_ns, at_ns }),
        }
    }
}

/// Returns the deliveries of a run's sensor; `None` if its source is no sensor.
pub fn read(manifest: &Manifest) -> Option<Received> {
    numbers::read(&manifest.root.join(FILE)).map(Received::of)
}

pub(super) fn open(manifest: &Manifest) -> Result<Numbers<9>, StageError> {
    Numbers::open(manifest, FILE)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_received_is_read_as_it_was_written() {
        let numbers = [1, 2, 3, 4, u64::MAX, 1, 1, 5, 6];
        for numbers in [numbers, [0; 9]] {
            assert_eq!(Received::of(numbers).to_numbers(), numbers);
        }
    }
}
