use gyre_geometry::scan::{MAX_AZIMUTHS, PolarScan};
use std::f64::consts::TAU;

/// Nodes per turn: ten between Navtech azimuths. The table is linear between nodes, so its error is
/// confined to the neighbourhood of a measured azimuth, and below `azimuths / (4 NODES)` of the
/// change in spacing there.
pub(super) const NODES: usize = 4096;

/// The most that an azimuth may lie behind the previous one, turns: encoder jitter, or a sweep that
/// ends past its start.
const BACKLASH: f64 = 0.1;

/// Fractional azimuths and times at bearings `k / NODES`, over the turn that starts at the first
/// azimuth.
#[derive(Debug)]
pub(super) struct BearingTable {
    /// Bearing of the first azimuth, turns in `[0, 1)`.
    pub start: f32,
    /// Fractional azimuth, `[0, azimuths]`; `azimuths` is the first one again.
    pub row: Box<[f32; NODES + 1]>,
    pub time_s: Box<[f32; NODES + 1]>,
    /// Bearings of the azimuths relative to the first, turns, non-decreasing, followed by 1.
    bearings: Vec<f64>,
}

impl BearingTable {
    pub fn new() -> Self {
        Self {
            start: 0.0,
            row: Box::new([0.0; NODES + 1]),
            time_s: Box::new([0.0; NODES + 1]),
            bearings: Vec::with_capacity(MAX_AZIMUTHS + 1),
        }
    }

    pub fn update(&mut self, scan: &PolarScan<'_>) {
        let azimuths = &scan.azimuth_rad[..scan.geometry.azimuths];
        let first = azimuths.first().copied().unwrap_or(0.0);
        self.start = (f64::from(first) / TAU).rem_euclid(1.0) as f32;
        if self.start >= 1.0 {
            self.start = 0.0; // rounded up to a whole turn
        }
        self.unwrap(azimuths);
        self.fill_nodes(scan);
    }

    fn unwrap(&mut self, azimuths: &[f32]) {
        self.bearings.clear();
        let (mut unwrapped, mut largest) = (0.0f64, 0.0f64);
        let mut before = azimuths.first().copied().unwrap_or(0.0);
        for &azimuth in azimuths {
            let step = (f64::from(azimuth) - f64::from(before)) / TAU;
            unwrapped += (step + BACKLASH).rem_euclid(1.0) - BACKLASH;
            largest = largest.max(unwrapped).min(1.0);
            self.bearings.push(largest);
            before = azimuth;
        }
        self.bearings.push(1.0);
    }

    fn fill_nodes(&mut self, scan: &PolarScan<'_>) {
        let last = scan.geometry.azimuths - 1;
        let seconds = |azimuth: usize| scan.time_s(azimuth.min(last));
        let mut below = 0;
        for node in 0..=NODES {
            let bearing = node as f64 / NODES as f64;
            while below < last && self.bearings[below + 1] <= bearing {
                below += 1;
            }
            let gap = self.bearings[below + 1] - self.bearings[below];
            let past = bearing - self.bearings[below];
            let share = if gap > 0.0 {
                (past / gap).clamp(0.0, 1.0)
            } else {
                0.0
            };
            // The time past the last azimuth stays constant: the first azimuth was measured a sweep
            // earlier.
            let (earlier, later) = (seconds(below), seconds(below + 1));
            self.row[node] = (below as f64 + share) as f32;
            self.time_s[node] = (earlier + share * (later - earlier)) as f32;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use gyre_geometry::scan::{OwnedScan, SweepGeometry};

    /// The table of a scan with azimuths (degrees) and times (seconds) only.
    fn measured(azimuths: &[(f32, f64)]) -> BearingTable {
        let mut scan = OwnedScan::of(SweepGeometry {
            azimuths: azimuths.len(),
            ..SweepGeometry::default()
        });
        for (i, &(degrees, time_s)) in azimuths.iter().enumerate() {
            scan.azimuth_rad[i] = degrees.to_radians();
            scan.stamp_ns[i] = (time_s * 1e9) as i64;
        }
        let mut table = BearingTable::new();
        table.update(&scan.view());
        table
    }

    fn near(table: &[f32; NODES + 1], degrees_past_start: f64) -> f32 {
        table[(degrees_past_start / 360.0 * NODES as f64).round() as usize]
    }

    #[test]
    fn rows_and_times_follow_uneven_azimuths_across_north() {
        let table = measured(&[(300.0, 0.0), (350.0, 0.1), (20.0, 0.15), (200.0, 0.4)]);
        assert!((table.start - 300.0 / 360.0).abs() < 1e-6);
        for (past, row, time_s) in [
            (0.0, 0.0, 0.0),
            (50.0, 1.0, 0.1),
            (65.0, 1.5, 0.125),
            (170.0, 2.5, 0.275),
        ] {
            assert!((near(&table.row, past) - row).abs() < 2e-3, "{past}");
            assert!((near(&table.time_s, past) - time_s).abs() < 2e-4, "{past}");
        }
    }

    #[test]
    fn between_last_and_first_azimuth_rows_increase_and_time_is_constant() {
        let table = measured(&[(10.0, 0.0), (130.0, 0.1), (250.0, 0.2)]);
        assert!((near(&table.row, 300.0) - 2.5).abs() < 2e-3);
        assert_eq!(near(&table.time_s, 300.0), 0.2);
        assert_eq!(table.row[NODES], 3.0);
    }

    #[test]
    fn an_encoder_that_steps_back_affects_that_row_only() {
        let table = measured(&[
            (0.0, 0.0),
            (359.9, 0.1),
            (90.0, 0.2),
            (89.0, 0.3),
            (180.0, 0.4),
        ]);
        assert!((near(&table.row, 45.0) - 1.5).abs() < 2e-2);
        assert!((near(&table.row, 135.5) - 3.5).abs() < 2e-2);
        assert!((near(&table.row, 270.0) - 4.5).abs() < 2e-2);
    }

    #[test]
    fn a_sweep_that_ends_past_its_start_ends_at_its_start() {
        let table = measured(&[(5.0, 0.0), (125.0, 0.1), (245.0, 0.2), (5.5, 0.3)]);
        assert!((near(&table.row, 180.0) - 1.5).abs() < 2e-3);
        assert!((near(&table.row, 300.0) - 2.5).abs() < 2e-3);
        assert!(table.row.iter().all(|&row| row <= 4.0));
    }
}
