//! The facts under which the scans of a drive overlap best.

use std::collections::BTreeMap;
use std::num::NonZeroUsize;
use std::thread;

use crate::{
    BLOCKS, Drive, Estimate, Fact, FactMatrix, FactVector, Revisit, Track,
    facts::FACTS,
    jackknife,
    pair::{PairSlope, View, compare},
};

/// Distances along the path between the scans of a pair, m. The longer, the more a wrong fact
/// displaces, and the less the scans have in common.
const BASELINES_M: [f64; 4] = [5.0, 10.0, 20.0, 35.0];
/// Distance along the path between the later scans of pairs, at least, m.
const SPACING_M: f64 = 2.5;
/// Pairs along the path, at most: of a longer drive they are farther apart.
const MAX_PAIRS: usize = 1200;
/// Views that a thread keeps: the scans within the longest baseline.
const VIEWS: usize = 24;

pub(crate) fn along(track: &Track) -> Vec<Revisit> {
    let path_m = track.path_m();
    let length_m = path_m.last().copied().unwrap_or_default();
    let spacing_m = SPACING_M.max(length_m * BASELINES_M.len() as f64 / MAX_PAIRS as f64);
    let (mut pairs, mut next_m) = (Vec::new(), 0.0);
    for (later, here_m) in path_m.iter().enumerate() {
        if *here_m < next_m {
            continue;
        }
        next_m = here_m + spacing_m;
        for baseline_m in BASELINES_M
            .iter()
            .filter(|baseline_m| **baseline_m <= *here_m)
        {
            let earlier = path_m.partition_point(|there_m| *there_m < here_m - baseline_m);
            if earlier < later && !track.is_broken(earlier, later) {
                let pose = track.poses[earlier].inv_mul(&track.poses[later]);
                pairs.push(Revisit {
                    later,
                    earlier,
                    pose,
                });
            }
        }
    }
    pairs
}

/// The slopes of all pairs under the facts of a track; `None` for a pair that is not determined.
pub(crate) fn slopes(drive: &Drive, track: &Track, pairs: &[Revisit]) -> Vec<Option<PairSlope>> {
    let threads = thread::available_parallelism().map_or(1, NonZeroUsize::get);
    let share = pairs.len().div_ceil(threads).max(1);
    thread::scope(|scope| {
        let of = |pairs| move || slopes_of(drive, track, pairs);
        let workers: Vec<_> = pairs
            .chunks(share)
            .map(|pairs| scope.spawn(of(pairs)))
            .collect();
        let joined = workers.into_iter().map(|worker| worker.join());
        joined
            .flat_map(|slopes| slopes.expect("a worker does not panic"))
            .collect()
    })
}

fn slopes_of(drive: &Drive, track: &Track, pairs: &[Revisit]) -> Vec<Option<PairSlope>> {
    let mut views = BTreeMap::new();
    let mut slopes = Vec::with_capacity(pairs.len());
    for pair in pairs {
        while views.len() > VIEWS {
            views.pop_first();
        }
        for scan in [pair.later, pair.earlier] {
            let view = || View::new(drive, scan, track);
            views.entry(scan).or_insert_with(view);
        }
        let [later, earlier] = [pair.later, pair.earlier].map(|scan| &views[&scan]);
        slopes.push(compare(drive, later, earlier, &pair.pose));
    }
    slopes
}

/// Returns the mean overlap of the same pairs of scans under several tracks with their facts.
pub(crate) fn overlaps<const N: usize>(
    drive: &Drive,
    pairs: &[Revisit],
    tracks: [&Track; N],
) -> [f64; N] {
    let all = tracks.map(|track| slopes(drive, track, pairs));
    // A pair that one of them does not determine would count for the others alone.
    let common: Vec<usize> = (0..pairs.len())
        .filter(|&pair| all.iter().all(|slopes| slopes[pair].is_some()))
        .collect();
    all.map(|slopes| {
        let overlaps = common.iter().filter_map(|&pair| slopes[pair]);
        overlaps.map(|slope| slope.overlap).sum::<f64>() / common.len().max(1) as f64
    })
}

/// The slopes of the overlap of all pairs, and how they change with each fact.
pub(crate) struct System {
    /// For each pair the scan that it belongs to, the slopes, and their derivatives.
    rows: Vec<(usize, FactVector, FactMatrix)>,
    scans: usize,
}

impl System {
    /// Measures the slopes under the facts of a track, and one step of each fact from there.
    pub fn measure(drive: &Drive, track: &Track, pairs: &[Revisit]) -> Self {
        let here = slopes(drive, track, pairs);
        let mut rows: Vec<_> = here
            .iter()
            .map(|slope| slope.map(|slope| (slope.slope, FactMatrix::zeros())))
            .collect();
        for fact in Fact::ALL {
            let mut stepped = track.clone();
            stepped.change[fact as usize] += fact.step();
            for (row, there) in rows.iter_mut().zip(slopes(drive, &stepped, pairs)) {
                *row = row
                    .take()
                    .zip(there)
                    .map(|((slope, mut derivatives), there)| {
                        derivatives
                            .set_column(fact as usize, &((slope - there.slope) / fact.step()));
                        (slope, derivatives)
                    });
            }
        }
        let rows = rows.into_iter().zip(pairs);
        let rows = rows.filter_map(|(row, pair)| {
            row.map(|(slope, derivatives)| (pair.later, slope, derivatives))
        });
        Self {
            rows: rows.collect(),
            scans: track.poses.len(),
        }
    }

    pub fn len(&self) -> usize {
        self.rows.len()
    }

    /// Solves for the change of the facts that makes the slopes vanish, with the standard
    /// deviations by the jackknife over blocks of the drive; the facts that are not in `free` keep
    /// their values. `None` if the pairs do not determine them.
    pub fn solve(&self, free: &[Fact]) -> Option<[Estimate; FACTS]> {
        jackknife(|left_out| self.solve_without(free, left_out))
    }

    fn solve_without(&self, free: &[Fact], left_out: Option<usize>) -> Option<FactVector> {
        let (mut slope, mut derivatives) = (FactVector::zeros(), FactMatrix::zeros());
        let block = |scan: usize| scan * BLOCKS / self.scans.max(1);
        for (scan, of_pair, by_fact) in &self.rows {
            if left_out != Some(block(*scan)) {
                slope += of_pair;
                derivatives += by_fact;
            }
        }
        for fixed in Fact::ALL.into_iter().filter(|fact| !free.contains(fact)) {
            let k = fixed as usize;
            slope[k] = 0.0;
            derivatives.row_mut(k).fill(0.0);
            derivatives.column_mut(k).fill(0.0);
            derivatives[(k, k)] = 1.0;
        }
        // A fact beyond the overlap's maximum has the slope of a hole, not of a hill.
        let rises = free
            .iter()
            .all(|fact| derivatives[(*fact as usize, *fact as usize)] > 0.0);
        // With pivots: the facts differ by orders of magnitude.
        derivatives
            .lu()
            .try_inverse()
            .filter(|_| rises)
            .map(|inverse| inverse * slope)
    }
}
