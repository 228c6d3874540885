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

use gyre_geometry::Twist;

use crate::{
    chain::continues,
    scan::{MAX_AZIMUTHS, PolarScan, flag},
};
use alignment::Alignment;
use echoes::Echoes;
use prediction::{Motion, Prediction};

pub use repair::repair;

/// The largest number of lost azimuths that are placed: two bursts of a tenth of RADIATE's turn.
pub const MAX_LOST: usize = 80;
/// The largest number of gaps in a turn: places where azimuths were lost together.
pub const MAX_GAPS: usize = 8;
/// The largest number of lost azimuths that are placed one by one. More are lost in bursts.
const MAX_SINGLE: usize = 7;

const MIN_AZIMUTHS: usize = 64;

/// By how much faster the vehicle may have become since the motion that predicts: it brakes or
/// accelerates by 1.2 m/s² for half a second.
const FASTER_MPS: [f64; 3] = [0.0, -0.6, 0.6];

/// Where azimuths of a turn were lost: gaps in order, each before one of the rows between two,
/// which are equally likely.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct LostAzimuths {
    gaps: [[u16; 3]; MAX_GAPS],
}

impl LostAzimuths {
    /// Creates it from gaps: the first and the last row before which azimuths may have been lost,
    /// and their number. A number of 0 ends the gaps; of more than [`MAX_GAPS`] the first are
    /// taken.
    pub fn of_gaps(gaps: impl IntoIterator<Item = [u16; 3]>) -> Self {
        let mut lost = Self::default();
        let gaps = gaps.into_iter().take_while(|[.., azimuths]| *azimuths > 0);
        lost.gaps
            .iter_mut()
            .zip(gaps)
            .for_each(|(to, gap)| *to = gap);
        lost
    }

    pub fn between(rows: impl IntoIterator<Item = [u16; 2]>) -> Self {
        Self::of_gaps(rows.into_iter().map(|[first, last]| [first, last, 1]))
    }

    /// Returns azimuths that may have been lost anywhere in a turn of `azimuths`: few of them one
    /// by one, more of them together.
    pub fn anywhere(count: usize, azimuths: usize) -> Self {
        let last = azimuths.saturating_sub(count) as u16;
        match count {
            0..=MAX_SINGLE => Self::between((0..count).map(|_| [0, last])),
            _ => Self::of_gaps([[0, last, count as u16]]),
        }
    }

    pub fn count(&self) -> usize {
        self.gaps.iter().map(|gap| usize::from(gap[2])).sum()
    }

    /// Returns, in order, the first and the last row before which azimuths may have been lost, and
    /// their number.
    pub fn gaps(&self) -> &[[u16; 3]] {
        let count = self.gaps.iter().take_while(|gap| gap[2] > 0).count();
        &self.gaps[..count]
    }

    /// Returns the number of azimuths in gaps of several whose place is unknown: it may be before
    /// more rows than the gap has azimuths.
    pub fn unplaced(&self) -> usize {
        let is_unknown = |gap: &&[u16; 3]| gap[2] > 1 && gap[1] - gap[0] > gap[2];
        let unknown = self.gaps().iter().filter(is_unknown);
        unknown.map(|gap| usize::from(gap[2])).sum()
    }

    /// Returns the variance of the mean of the rows' azimuths due to unknown places, rad², in a
    /// turn of `azimuths`.
    pub fn variance_of_mean_rad2(&self, azimuths: usize) -> f32 {
        let measured = azimuths.saturating_sub(self.count()).max(1) as f32;
        // The mean falls back by the gap for each row behind the place: its variance is the
        // variance of one of n places, (n² - 1) / 12.
        let of_gaps = self.gaps().iter().map(|[first, last, azimuths]| {
            let places = f32::from(last - first) + 1.0;
            f32::from(*azimuths).powi(2) * (places * places - 1.0) / 12.0
        });
        let step_rad = TAU / azimuths.max(1) as f32;
        of_gaps.sum::<f32>() * (step_rad / measured).powi(2)
    }

    /// Returns the expected azimuth of a row, in steps of the turn.
    fn azimuth_of(&self, row: f32) -> f32 {
        let lost = self.gaps().iter().map(|gap| {
            let [first, last, azimuths] = gap.map(f32::from);
            azimuths * ((row - first + 1.0) / (last - first + 1.0)).clamp(0.0, 1.0)
        });
        row + lost.sum::<f32>()
    }
}

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
