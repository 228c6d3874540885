//! Table IIIa: how long each search takes for a pair of scans, refinement included where a row has it, on one thread of this
//! process.

use std::{hint::black_box, path::Path, time::Instant};

use gyre_masking::{Masker, Sweep};
use gyre_messages::{MotionEstimate, Pair};
use gyre_radar::{OwnedScan, Point};
use gyre_scan_matching::{ConfigError, Refinement, RefinementKind, ShapeError};
use serde::Serialize;

use super::{
    Sequence,
    papers::Figures,
    peer::{Peer, PeerTimes},
    rows::{Line, Row, lines},
};
use crate::{
    Failure,
    configuration::{Configuration, SearchKind},
    search::{Search, search},
};

/// Scans of the sequence whose searches are timed, in turn.
const SCANS: usize = 8;
/// Untimed passes before each half.
const BURN_IN: usize = 5;

/// The table and how it was measured.
#[derive(Debug, Serialize)]
pub struct Times {
    /// The sequence's folder.
    pub data: String,
    /// Its scans that were searched.
    pub scans: usize,
    /// Timed passes of each search, before the peer and after it together.
    pub passes: usize,
    /// The peer's version of PyTorch.
    pub peer_torch: Option<String>,
    /// Lines, size by size.
    pub lines: Vec<TimeLine>,
}

/// A row at one size.
#[derive(Debug, Serialize)]
pub struct TimeLine {
    /// Cells a side.
    pub n: usize,
    /// The row.
    pub row: &'static str,
    /// What this program takes; `None` where it has no such row.
    pub ours: Option<Median>,
    /// The peer's median, ms.
    pub peer_ms: Option<f64>,
    /// How many times longer the peer takes.
    pub peer_over_ours: Option<f64>,
    /// The paper's rates on a laptop and on a Jetson, Hz.
    pub paper_hz: [Option<f64>; 2],
}

/// A median time.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Median {
    /// Metres a cell.
    pub cell_m: f32,
    /// Angles that were tried, where all are.
    pub angles: Option<usize>,
    /// Of all passes, ms.
    pub ms: f64,
    /// Of the passes before and after the peer's, ms: alike on a quiet machine.
    pub halves_ms: [f64; 2],
}

/// Times all rows at all `sizes` on scans of `sequence`: `passes` passes, then the peer, then as many passes again.
pub fn measure(
    sequence: &Sequence,
    sizes: &[usize],
    passes: usize,
    peer: Option<&Peer>,
    out: &Path,
) -> Result<Times, Failure> {
    let scans = sequence.scans(SCANS)?;
    let at_size = |&n: &usize| {
        let timed = |line: Line| Ok((line, line.row.map(|row| Timer::new(sequence, row, n, &scans)).transpose()?));
        let timed: Result<Vec<_>, Failure> = lines(Figures::has_times).into_iter().map(timed).collect();
        Ok((n, timed?))
    };
    let sizes: Result<Vec<_>, Failure> = sizes.iter().map(at_size).collect();
    let angles = sequence.configuration(&[])?.exhaustive.candidates();
    let both = 2 * passes;
    let mut times = Times {
        data: sequence.data.display().to_string(),
        scans: scans.len(),
        passes: both,
        peer_torch: None,
        lines: Vec::new(),
    };
    for (n, mut timed) in sizes? {
        half(&mut timed, passes)?;
        let report = out.join(format!("peer-{n}.json"));
        let theirs = peer.map(|peer| peer.time(n, both, angles, &report)).transpose()?;
        half(&mut timed, passes)?;
        times.lines.extend(timed.into_iter().map(|(line, timer)| TimeLine::new(n, &line, timer, theirs.as_ref())));
        times.peer_torch = theirs.map(|theirs| theirs.torch);
    }
    Ok(times)
}

fn half(timed: &mut [(Line, Option<Timer>)], passes: usize) -> Result<(), ShapeError> {
    timed.iter_mut().filter_map(|(_, timer)| timer.as_mut()).try_for_each(|timer| timer.half(passes))
}

impl TimeLine {
    fn new(n: usize, line: &Line, timer: Option<Timer>, peer: Option<&PeerTimes>) -> Self {
        let ours = timer.map(|timer| timer.median());
        let peer_ms = line.peer.and_then(|row| peer?.median_ms(n, row));
        Self {
            n,
            row: line.name,
            ours,
            peer_ms,
            peer_over_ours: ours.and_then(|ours| Some(peer_ms? / ours.ms)),
            paper_hz: line.figures.map_or([None; 2], |figures| figures.hz(n)),
        }
    }
}

/// The refinement of a configuration, with the points and the times of the scans.
struct Refiner {
    refinement: Refinement,
    points: Vec<Vec<Point>>,
    stamps_ns: Vec<i64>,
}

impl Refiner {
    /// `None` where the configuration refines nothing.
    fn new(
        configuration: &Configuration,
        points: Vec<Vec<Point>>,
        scans: &[OwnedScan],
    ) -> Result<Option<Self>, ConfigError> {
        if configuration.refinement.kind == RefinementKind::None {
            return Ok(None);
        }
        let refinement = Refinement::new(&configuration.refinement, configuration.points.capacity)?;
        let stamps_ns = scans.iter().map(|scan| scan.geometry.stamp_ns).collect();
        Ok(Some(Self { refinement, points, stamps_ns }))
    }

    /// Refines the motion from scan `later - 1` to scan `later`. Nobody drove from the last scan to the first: a chain starts
    /// there.
    fn next(&mut self, seq: u64, later: usize, motion: &MotionEstimate) {
        let Some(earlier) = later.checked_sub(1) else { return self.refinement.start() };
        let interval_ns = self.stamps_ns[later].saturating_sub(self.stamps_ns[earlier]);
        let motion = MotionEstimate { interval_ns, ..*motion };
        let (later, earlier) = (&self.points[later], &self.points[earlier]);
        black_box(gyre_refinement::refine(&mut self.refinement, seq, later, earlier, &motion));
    }
}

/// The search of one row on rasters of one size, and how long it took.
struct Timer {
    cell_m: f32,
    angles: Option<usize>,
    search: Search,
    refiner: Option<Refiner>,
    rasters: Vec<Vec<f32>>,
    seq: u64,
    halves_ms: [Vec<f64>; 2],
}

impl Timer {
    /// The same area at every size: that of the row's own configuration.
    fn new(sequence: &Sequence, row: &Row, n: usize, scans: &[OwnedScan]) -> Result<Self, Failure> {
        let mut configuration = sequence.configuration(&row.changes())?;
        let raster = &mut configuration.raster;
        raster.cell_m *= raster.n as f32 / n as f32;
        raster.n = n;
        let fails = |reason: &dyn std::error::Error| format!("{} at {n} cells a side: {reason}", row.name);
        let mut masker =
            Masker::new(raster, &configuration.points, &configuration.masking).map_err(|error| fails(&error))?;
        let mut rasters = vec![vec![0.0; n * n]; scans.len()];
        let mut points = vec![vec![Point::default(); configuration.points.capacity]; scans.len()];
        for (number, scan) in scans.iter().enumerate() {
            let sweep = Sweep { number: number as u64, scan: scan.view(), motion: None };
            let twist = masker.mask(&sweep, None, &mut rasters[number]).map_err(|error| fails(&error))?;
            let found = masker.points(&sweep.scan, twist, &mut points[number]).map_err(|error| fails(&error))?;
            points[number].truncate(found);
        }
        let refiner = Refiner::new(&configuration, points, scans).map_err(|error| fails(&error))?;
        let exhaustive = configuration.search.kind == SearchKind::Exhaustive;
        Ok(Self {
            cell_m: configuration.raster.cell_m,
            angles: exhaustive.then(|| configuration.exhaustive.candidates()),
            search: search(&configuration, masker.rasters()).map_err(|error| fails(&error))?,
            refiner,
            rasters,
            seq: 0,
            halves_ms: [Vec::new(), Vec::new()],
        })
    }

    /// Times `passes` passes: those of the first half, then those of the second.
    fn half(&mut self, passes: usize) -> Result<(), ShapeError> {
        for _ in 0..BURN_IN {
            self.pass()?;
        }
        let times: Result<Vec<f64>, ShapeError> = (0..passes).map(|_| self.pass()).collect();
        let half = usize::from(!self.halves_ms[0].is_empty());
        self.halves_ms[half] = times?;
        Ok(())
    }

    /// Searches, and refines where the row does, the motion of the next pair; the time it took, ms.
    fn pass(&mut self) -> Result<f64, ShapeError> {
        self.seq += 1;
        let scan = |seq: u64| seq as usize % self.rasters.len();
        let (later, earlier) = (scan(self.seq), scan(self.seq - 1));
        let pair = Pair { later: &self.rasters[later], earlier: Some(&self.rasters[earlier]) };
        let start = Instant::now();
        let motion = black_box((self.search)(self.seq, black_box(pair))?);
        if let Some(refiner) = &mut self.refiner {
            refiner.next(self.seq, later, &motion);
        }
        Ok(start.elapsed().as_secs_f64() * 1e3)
    }

    fn median(self) -> Median {
        let halves_ms = [0, 1].map(|half| median(self.halves_ms[half].clone()));
        Median { cell_m: self.cell_m, angles: self.angles, ms: median(self.halves_ms.concat()), halves_ms }
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
