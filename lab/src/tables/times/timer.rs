//! A row at one size: its passes, and how long they took.

use std::{hint::black_box, time::Instant};

use gyre_geometry::SparsePoint;
use gyre_masking::{MaskKind, Masker, MaskingConfig, Sweep};
use gyre_messages::{MaskedHeader, MotionEstimate, Pair};
use gyre_radar::OwnedScan;
use gyre_scan_matching::{ConfigError, RefinementKind, Refiner as Matcher};

use super::{Median, learned::Learned};
use crate::{models::Model, sequence::Sequence, tables::rows::Row};
use gyre::{
    Failure,
    configuration::{Configuration, SearchKind},
    search::{Search, search},
};

/// Untimed passes before each half.
const BURN_IN: usize = 5;

/// What a row does with a pair of scans, in the order in which it does it, and how long that took.
pub struct Timer {
    /// The network that masks.
    pub model: Option<Model>,
    cell_m: f32,
    angles: Option<usize>,
    learned: Option<Learned>,
    search: Option<Search>,
    refiner: Option<Refiner>,
    rasters: Vec<Vec<f32>>,
    seq: u64,
    halves_ms: [Vec<f64>; 2],
}

impl Timer {
    /// The same area at every size: that of the row's own configuration, or that of its network.
    pub fn new(
        sequence: &Sequence,
        row: &Row,
        changes: &[String],
        model: Option<Model>,
        n: usize,
        scans: &[OwnedScan],
    ) -> Result<Self, Failure> {
        let mut configuration = sequence.configuration(changes)?;
        let raster = &mut configuration.raster;
        let scaled = raster.cell_m * raster.n as f32 / n as f32;
        (raster.n, raster.cell_m) = (n, model.as_ref().map_or(scaled, |model| model.cell_m));
        configuration.masking.threads = 1;
        let timer = Self::of(&configuration, !row.mask_alone, scans);
        let timer =
            timer.map_err(|reason| format!("{} at {n} cells a side: {reason}", row.name))?;
        Ok(Self { model, ..timer })
    }

    fn of(
        configuration: &Configuration,
        searches: bool,
        scans: &[OwnedScan],
    ) -> Result<Self, Failure> {
        let Prepared { rasters, points } = prepare(configuration, scans)?;
        let learned = Learned::load(configuration)?;
        let looks_at = learned.as_ref().map_or(1, Learned::scans);
        let exhaustive = configuration.search.kind == SearchKind::Exhaustive && learned.is_none();
        Ok(Self {
            model: None,
            cell_m: configuration.raster.cell_m,
            angles: exhaustive.then(|| configuration.exhaustive.candidates()),
            learned,
            search: searches
                .then(|| search(configuration, looks_at))
                .transpose()?,
            refiner: Refiner::new(configuration, points, scans)?,
            rasters,
            seq: 0,
            halves_ms: [Vec::new(), Vec::new()],
        })
    }

    /// Times `passes` passes: those of the first half, then those of the second.
    pub fn half(&mut self, passes: usize) -> Result<(), Failure> {
        for _ in 0..BURN_IN {
            self.pass()?;
        }
        let times: Result<Vec<f64>, Failure> = (0..passes).map(|_| self.pass()).collect();
        let half = usize::from(!self.halves_ms[0].is_empty());
        self.halves_ms[half] = times?;
        Ok(())
    }

    /// Masks, searches and refines the next pair, as far as the row does; the time it took, ms.
    fn pass(&mut self) -> Result<f64, Failure> {
        self.seq += 1;
        let scan = |seq: u64| seq as usize % self.rasters.len();
        let (later, earlier) = (scan(self.seq), scan(self.seq - 1));
        let rasters = [later, earlier].map(|scan| self.rasters[scan].as_slice());
        if let Some(learned) = &mut self.learned {
            learned.take(rasters);
        }
        let start = Instant::now();
        let pair = match &mut self.learned {
            Some(learned) => learned.mask()?,
            None => Pair {
                later: rasters[0],
                earlier: Some(rasters[1]),
            },
        };
        if let Some(search) = &mut self.search {
            let motion = black_box(search(self.seq, black_box(pair))?);
            if let Some(refiner) = &mut self.refiner {
                refiner.next(self.seq, later, &motion);
            }
        }
        Ok(start.elapsed().as_secs_f64() * 1e3)
    }

    pub fn median(self) -> Median {
        let halves_ms = [0, 1].map(|half| median(self.halves_ms[half].clone()));
        Median {
            cell_m: self.cell_m,
            angles: self.angles,
            ms: median(self.halves_ms.concat()),
            halves_ms,
        }
    }
}

/// What a row's passes work on, scan by scan.
struct Prepared {
    /// Before any network.
    rasters: Vec<Vec<f32>>,
    /// As masking makes them.
    points: Vec<Vec<SparsePoint>>,
}

fn prepare(configuration: &Configuration, scans: &[OwnedScan]) -> Result<Prepared, Failure> {
    let (raster, masking) = (&configuration.raster, &configuration.masking);
    let kind = if masking.kind == MaskKind::Learned {
        MaskKind::Threshold
    } else {
        masking.kind
    };
    let masker = |masking: &MaskingConfig| Masker::new(raster, &configuration.points, masking);
    let (mut masker, mut plain) = (
        masker(masking)?,
        masker(&MaskingConfig {
            kind,
            ..masking.clone()
        })?,
    );
    let cells = raster.n * raster.n;
    let mut masked = vec![0.0; masker.rasters() * MaskedHeader::raster_values(cells)];
    let mut rasters = vec![vec![0.0; cells]; scans.len()];
    let mut points = vec![vec![SparsePoint::default(); configuration.points.capacity]; scans.len()];
    let sweep = |number: usize| Sweep {
        number: number as u64,
        scan: scans[number].view(),
        motion: None,
    };
    for (number, (raster, points)) in rasters.iter_mut().zip(&mut points).enumerate() {
        let before = number.checked_sub(1).map(sweep);
        let twist = masker.mask(&sweep(number), before.as_ref(), &mut masked)?;
        let found = masker.points(&scans[number].view(), twist, points)?;
        points.truncate(found);
        plain.mask(&sweep(number), None, raster)?;
    }
    Ok(Prepared { rasters, points })
}

/// The refinement of a configuration, with the points and the times of the scans.
struct Refiner {
    refinement: Matcher,
    points: Vec<Vec<SparsePoint>>,
    stamps_ns: Vec<i64>,
}

impl Refiner {
    /// `None` where the configuration refines nothing.
    fn new(
        configuration: &Configuration,
        points: Vec<Vec<SparsePoint>>,
        scans: &[OwnedScan],
    ) -> Result<Option<Self>, ConfigError> {
        if configuration.refinement.kind == RefinementKind::None {
            return Ok(None);
        }
        let refinement = Matcher::new(&configuration.refinement, configuration.points.capacity)?;
        let stamps_ns = scans.iter().map(|scan| scan.geometry.stamp_ns).collect();
        Ok(Some(Self {
            refinement,
            points,
            stamps_ns,
        }))
    }

    /// Refines the motion from scan `later - 1` to scan `later`. Nobody drove from the last scan to the first: a chain starts
    /// there.
    fn next(&mut self, seq: u64, later: usize, motion: &MotionEstimate) {
        let Some(earlier) = later.checked_sub(1) else {
            return self.refinement.reset();
        };
        let interval_ns = self.stamps_ns[later].saturating_sub(self.stamps_ns[earlier]);
        let motion = MotionEstimate {
            interval_ns,
            ..*motion
        };
        let (later, earlier) = (&self.points[later], &self.points[earlier]);
        black_box(gyre_refinement::refine(
            &mut self.refinement,
            seq,
            later,
            earlier,
            &motion,
        ));
    }
}

/// The upper median; 0 of nothing.
fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    values.get(values.len() / 2).copied().unwrap_or(0.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_median_is_the_one_in_the_middle() {
        assert_eq!(median(vec![9.0, 1.0, 2.0]), 2.0);
        assert_eq!(median(vec![4.0, 1.0]), 4.0);
        assert_eq!(median(Vec::new()), 0.0);
    }
}
