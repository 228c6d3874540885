//! Azimuths that are bright over their whole length: a strong return lifts the receiver's floor, or another radar interferes.

use gyre_radar::PolarScan;
use serde::Serialize;

use super::histogram::Histogram;

/// An azimuth's floor is the power that this share of its outer half does not exceed: returns hardly reach it.
const FLOOR_SHARE: f64 = 0.2;
/// A streak's floor is more than this above the median of its scan's, counts.
const LIFT: u8 = 10;

/// The streaks of a recording.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Streaks {
    /// Share of azimuths that are streaks.
    pub share: f64,
    /// Groups of neighbouring streaks, a scan.
    pub groups_a_scan: f64,
    /// Azimuths that a group has, on average.
    pub mean_width: f64,
    /// The floors of all azimuths: 5, 25, 50, 75, 95 and 99 % do not exceed these, counts.
    pub floor_percentiles: [u8; 6],
}

/// Counts streaks.
#[derive(Clone, Debug, Default)]
pub struct StreakCounter {
    floors: Histogram,
    /// The floors of the current scan.
    scan: Vec<u8>,
    scans: u64,
    streaks: u64,
    groups: u64,
}

impl StreakCounter {
    /// Counts those of a scan.
    pub fn add(&mut self, scan: &PolarScan<'_>) {
        self.scan.clear();
        self.scan
            .extend((0..scan.geometry.azimuths).map(|azimuth| floor(scan.row(azimuth))));
        self.floors.add(&self.scan);
        let mut of_scan = Histogram::default();
        of_scan.add(&self.scan);
        let median = of_scan.percentile(0.5);
        let is_streak = |floor: u8| floor.saturating_sub(median) > LIFT;
        let before = self
            .scan
            .last()
            .copied()
            .into_iter()
            .chain(self.scan.iter().copied());
        for (floor, before) in self.scan.iter().zip(before) {
            self.streaks += u64::from(is_streak(*floor));
            self.groups += u64::from(is_streak(*floor) && !is_streak(before));
        }
        self.scans += 1;
    }

    /// Returns the counts.
    pub fn finish(&self) -> Streaks {
        let ratio = |a: u64, b: u64| if b == 0 { 0.0 } else { a as f64 / b as f64 };
        Streaks {
            share: ratio(self.streaks, self.floors.total()),
            groups_a_scan: ratio(self.groups, self.scans),
            mean_width: ratio(self.streaks, self.groups),
            floor_percentiles: [0.05, 0.25, 0.5, 0.75, 0.95, 0.99]
                .map(|share| self.floors.percentile(share)),
        }
    }
}

fn floor(row: &[u8]) -> u8 {
    let mut outer = Histogram::default();
    outer.add(&row[row.len() / 2..]);
    outer.percentile(FLOOR_SHARE)
}
