//! The reflections of the vehicle itself: returns that stay where they are in the sensor's frame
//! while the vehicle moves.

use std::f64::consts::TAU;

use gyre_geometry::PolarScan;

const CELL_M: f64 = 0.25;
const CELLS: usize = (OwnReflections::REACH_M / CELL_M) as usize;
const SECTORS: usize = 90;
/// Least share of scans with power in a cell of the vehicle's own reflections.
const SHARE: f64 = 0.9;
const MIN_SCANS: usize = 50;

#[derive(Clone, Debug)]
pub struct OwnReflections {
    counts: Vec<usize>,
    scans: usize,
}

impl Default for OwnReflections {
    fn default() -> Self {
        Self {
            counts: vec![0; SECTORS * CELLS],
            scans: 0,
        }
    }
}

impl OwnReflections {
    /// The longest range of the search, m.
    pub const REACH_M: f64 = 15.0;

    /// Adds a scan that was measured while the vehicle moved; power above `floor` counts.
    pub(crate) fn add(&mut self, scan: &PolarScan<'_>, floor: u8) {
        let mut seen = vec![false; SECTORS * CELLS];
        for row in 0..scan.geometry.azimuths {
            let turns = f64::from(scan.azimuth_rad[row]) / TAU;
            let sector = (turns * SECTORS as f64) as usize % SECTORS;
            for (bin, power) in scan.row(row).iter().enumerate() {
                let range_m = f64::from(scan.range_m(bin as f32));
                if range_m >= Self::REACH_M {
                    break;
                }
                if *power > floor {
                    seen[sector * CELLS + (range_m.max(0.0) / CELL_M) as usize] = true;
                }
            }
        }
        self.scans += 1;
        self.counts
            .iter_mut()
            .zip(seen)
            .for_each(|(count, seen)| *count += usize::from(seen));
    }

    /// Returns the range beyond which nothing stays in place, m; `None` after too few moving scans.
    pub fn end_m(&self) -> Option<f64> {
        let stays = |count: &usize| *count as f64 >= SHARE * self.scans as f64;
        let own = self
            .counts
            .iter()
            .enumerate()
            .filter(|(_, count)| stays(count));
        let last = own.map(|(k, _)| k % CELLS + 1).max().unwrap_or(0);
        (self.scans >= MIN_SCANS).then_some(last as f64 * CELL_M)
    }
}
