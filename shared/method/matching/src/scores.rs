use std::sync::Arc;

use gyre_geometry::{SettingError, check};
use nalgebra::Vector2;

use crate::{
    config::{METRES, Overlap, Peak},
    kernels,
    overlap::OverlapEnergy,
    peak::{PlanePeak, SUPPORT, plane_peak},
};

/// Half width of the neighbourhood where a second maximum counts as the same peak, cells.
const SAME_PEAK_CELLS: isize = 3;

pub(crate) type Shift = (isize, isize);

/// Scores of all shifts of up to `reach + SUPPORT` cells; maxima are looked for within `reach`.
pub(crate) struct Scores {
    reach: isize,
    /// Row (and column) of the transform for each shift.
    pub wrapped: Arc<[usize]>,
    values: Vec<f32>,
}

impl Scores {
    /// The smallest transform that keeps shifts of n x n rasters within `reach` free of
    /// wrap-around: n + reach, not 2 n - 1.
    pub fn min_size(n: usize, reach: usize) -> usize {
        n + Self::around(reach)
    }

    pub fn around(reach: usize) -> usize {
        reach + SUPPORT
    }

    /// Scores that are read from transforms of `size` a side.
    pub fn new(reach: usize, size: usize) -> Self {
        let around = Self::around(reach) as isize;
        let wrapped: Arc<[usize]> = (-around..=around)
            .map(|s| s.rem_euclid(size as isize) as usize)
            .collect();
        Self {
            reach: reach as isize,
            values: vec![0.0; wrapped.len().pow(2)],
            wrapped,
        }
    }

    pub fn fill<T: Copy>(&mut self, r: usize, row: &[T], score: impl Fn(T) -> f32) {
        let side = self.wrapped.len();
        for (value, &column) in self.values[r * side..][..side]
            .iter_mut()
            .zip(&*self.wrapped)
        {
            *value = score(row[column]);
        }
    }

    /// Normalises the scores by the overlap. `energy` is the energy that they have been divided by
    /// so far.
    pub fn normalise(
        &mut self,
        overlap: Overlap,
        later: &OverlapEnergy,
        turned: &OverlapEnergy,
        energy: f64,
    ) {
        match overlap {
            Overlap::None => {}
            // A shift by s drops the first s rows of g' and the last s rows of f.
            Overlap::Energy => {
                kernels::divide_by_share(&mut self.values, &later.left, &turned.left, energy)
            }
        }
    }

    /// The score at a shift of (down, right) cells, within `reach + SUPPORT`.
    fn at(&self, down: isize, right: isize) -> f64 {
        let side = self.wrapped.len() as isize;
        let around = side / 2;
        f64::from(self.values[((down + around) * side + right + around) as usize])
    }

    fn scored(&self) -> impl Iterator<Item = (Shift, f64)> {
        let reach = self.reach;
        (-reach..=reach).flat_map(move |i| (-reach..=reach).map(move |j| ((i, j), self.at(i, j))))
    }

    pub fn highest(&self) -> Option<Shift> {
        let finite = self.scored().filter(|(_, score)| score.is_finite());
        let best = finite.fold(None, |best: Option<(Shift, f64)>, new| match best {
            Some(old) if old.1 >= new.1 => Some(old),
            _ => Some(new),
        })?;
        (best.1 > 0.0).then_some(best.0)
    }

    /// The peak about the highest score. Its offset is the whole shift.
    pub fn peak(&self, kind: Peak, best: Shift) -> PlanePeak {
        let peak = plane_peak(kind, |i, j| self.at(best.0 + i, best.1 + j));
        PlanePeak {
            offset: Vector2::new(best.0 as f64, best.1 as f64) + peak.offset,
            ..peak
        }
    }

    pub fn runner_up(&self, best: Shift) -> Option<(Shift, f64)> {
        let apart = |(i, j): Shift| (i - best.0).abs().max((j - best.1).abs()) > SAME_PEAK_CELLS;
        let summit = |(i, j): Shift, score: f64| {
            (-1..=1).all(|a| (-1..=1).all(|b| self.at(i + a, j + b) <= score))
        };
        let mut second: Option<(Shift, f64)> = None;
        for (shift, score) in self.scored() {
            if second.is_none_or(|(_, s)| score > s) && apart(shift) && summit(shift, score) {
                second = Some((shift, score));
            }
        }
        second
    }
}

pub(crate) fn check_side(n: usize) -> Result<(), SettingError> {
    let cells = ([16.0, 8192.0], "16 to 8192 cells a side");
    check("raster", "n", n as f64, cells)
}

pub(crate) fn check_raster(n: usize, cell_m: f64) -> Result<(), SettingError> {
    check_side(n)?;
    check("raster", "cell_m", cell_m, METRES)
}

/// The largest shift of a search over rasters of `n` x `n` cells of `cell_m` metres, cells.
pub(crate) fn reach_cells(
    n: usize,
    cell_m: f64,
    section: &'static str,
    reach_m: f64,
) -> Result<usize, SettingError> {
    check_raster(n, cell_m)?;
    let reach = (reach_m / cell_m + 1e-9).floor();
    match (1.0..=(n / 2 - SUPPORT) as f64).contains(&reach) {
        true => Ok(reach as usize),
        false => Err(SettingError {
            section,
            key: "reach_m",
            value: reach_m,
            expected: "at least one cell, less than half the raster",
        }),
    }
}
