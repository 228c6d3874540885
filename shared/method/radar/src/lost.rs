//! Lost azimuths: where the host of a radar lost azimuths of a turn.
//!
//! The rows behind a lost azimuth have moved up by one. The last rows of the image are *stale*:
//! they hold the powers of the turn before ([`flag::STALE`]). So it is known how many azimuths were
//! lost, but not where. [`LostAzimuthFinder`] finds that by aligning a scan with the one before it.

mod alignment;
mod echoes;
mod prediction;
mod repair;
#[cfg(test)]
mod tests;

use std::{
    f32::consts::{PI, TAU},
    mem::swap,
};

use alignment::Alignment;
use echoes::Echoes;
use gyre_geometry::{
    LostAzimuths, Twist, continues,
    scan::{MAX_AZIMUTHS, PolarScan, flag},
};
use prediction::{Motion, Prediction};

pub use repair::repair;

/// The largest number of lost azimuths that are placed: two bursts of a tenth of RADIATE's turn.
pub const MAX_LOST: usize = 80;

const MIN_AZIMUTHS: usize = 64;

/// By how much faster the vehicle may have become since the motion that predicts: it brakes or
/// accelerates by 1.2 m/s² for half a second.
const FASTER_MPS: [f64; 3] = [0.0, -0.6, 0.6];

#[derive(Clone, Debug, Default)]
pub struct LostAzimuthFinder {
    rows: Echoes,
    previous: Option<Previous>,
    /// The echoes of that scan, each at its azimuth: only where the next scan has lost some.
    placed: Echoes,
    prediction: Prediction,
    alignment: Alignment,
}

#[derive(Clone, Debug, Default)]
struct Previous {
    stamp_ns: i64,
    rows: Echoes,
    lost: LostAzimuths,
}

impl LostAzimuthFinder {
    /// Finds where azimuths of the next scan were lost. `twist` predicts its motion from the scan
    /// before. Without it, or without a scan before, each may have been lost anywhere. The scan is
    /// to pass [`PolarScan::check`].
    pub fn find(&mut self, scan: &PolarScan<'_>, twist: Option<Twist>) -> LostAzimuths {
        if !self.read(scan) {
            return LostAzimuths::default();
        }
        let count = stale_rows(scan);
        let lost = match (&self.previous, twist, count) {
            (_, _, 0) => LostAzimuths::default(),
            (Some(previous), Some(twist), _)
                if continues(previous.stamp_ns, scan.geometry.stamp_ns)
                    && previous.rows.layout == self.rows.layout
                    && scan.geometry.azimuths >= MIN_AZIMUTHS
                    && self.rows.layout.cells > 1
                    && count <= MAX_LOST =>
            {
                self.placed.place(&previous.rows, &previous.lost);
                self.alignment.begin();
                for faster_mps in FASTER_MPS {
                    let twist = Twist {
                        vx_mps: twist.vx_mps + faster_mps,
                        ..twist
                    };
                    let motion = Motion::new(previous.stamp_ns, scan, &twist);
                    self.prediction.make(&self.placed, &motion);
                    self.alignment.add(&self.prediction, &self.rows, count);
                }
                self.alignment.found(scan.geometry.azimuths - count, count)
            }
            _ => LostAzimuths::anywhere(count, scan.geometry.azimuths),
        };
        self.remember(scan, &lost);
        lost
    }

    /// Makes a scan the one before the next, to resume after a restart. `lost` are its lost
    /// azimuths.
    pub fn set_previous(&mut self, scan: &PolarScan<'_>, lost: &LostAzimuths) {
        if self.read(scan) {
            self.remember(scan, lost);
        }
    }

    /// Reads the rows of a scan. Returns `false` if its azimuths are measured, so that none was
    /// lost unseen.
    fn read(&mut self, scan: &PolarScan<'_>) -> bool {
        let assumed = |flags: &u8| flags & flag::ASSUMED != 0;
        let is_assumed = scan.flags.first().is_some_and(assumed);
        match is_assumed {
            true => self.rows.read(scan),
            false => self.previous = None,
        }
        is_assumed
    }

    fn remember(&mut self, scan: &PolarScan<'_>, lost: &LostAzimuths) {
        let previous = self.previous.get_or_insert_default();
        previous.stamp_ns = scan.geometry.stamp_ns;
        previous.lost = *lost;
        swap(&mut previous.rows, &mut self.rows);
    }

    pub fn reset(&mut self) {
        self.previous = None;
    }
}

#[derive(Debug, Default)]
pub struct PlacedRows {
    azimuth_rad: Vec<f32>,
    stamp_ns: Vec<i64>,
}

impl PlacedRows {
    /// Returns the scan with each measured row at its azimuth, without its stale rows. A scan that
    /// has lost none stays as it is.
    pub fn place<'a>(&'a mut self, scan: &PolarScan<'a>, lost: &LostAzimuths) -> PolarScan<'a> {
        let count = lost.count();
        if count == 0 || count > stale_rows(scan) {
            return *scan;
        }
        let azimuths = scan.geometry.azimuths;
        let rows = 0..azimuths - count;
        self.azimuth_rad.clear();
        self.stamp_ns.clear();
        // For any scan, so that later ones allocate nothing.
        self.azimuth_rad.reserve(MAX_AZIMUTHS);
        self.stamp_ns.reserve(MAX_AZIMUTHS);
        for row in rows.clone() {
            let azimuth = lost.azimuth_of(row as f32).min((azimuths - 1) as f32);
            let (before, share) = (azimuth as usize, azimuth.fract());
            let after = (before + 1).min(azimuths - 1);
            let (start, end) = (scan.azimuth_rad[before], scan.azimuth_rad[after]);
            // Angles may wrap around anywhere.
            let step = || (end - start + PI).rem_euclid(TAU) - PI;
            self.azimuth_rad.push(match share == 0.0 {
                true => start,
                false => (start + share * step()).rem_euclid(TAU),
            });
            let (start, end) = (scan.stamp_ns[before], scan.stamp_ns[after]);
            let passed_ns = share as f64 * (end - start) as f64;
            self.stamp_ns.push(start + passed_ns as i64);
        }
        let mut placed = *scan;
        placed.geometry.azimuths = rows.len();
        placed.azimuth_rad = &self.azimuth_rad;
        placed.stamp_ns = &self.stamp_ns;
        placed.flags = &scan.flags[rows];
        placed
    }
}

pub fn stale_rows(scan: &PolarScan<'_>) -> usize {
    let rows = scan.flags.iter().rev();
    let stale = rows.take_while(|flags| **flags & flag::STALE != 0).count();
    // At least half a turn was measured.
    stale.min(scan.geometry.azimuths / 2)
}
