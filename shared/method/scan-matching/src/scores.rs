use std::sync::Arc;

use nalgebra::Vector2;

use crate::config::{ConfigError, Overlap, Peak, Section, positive};
use crate::kernels::{self, MIN_SHARE};
use crate::overlap::OverlapEnergy;
use crate::peak::{PlanePeak, SUPPORT, plane_peak, soft_argmax};

/// Half width of the neighbourhood where a second maximum counts as the same peak, cells.
const SAME_PEAK_CELLS: isize = 3;

pub(crate) type Shift = (isize, isize);

/// Scores of all shifts of up to `reach + SUPPORT` cells; maxima are looked for within `reach`.
pub(crate) struct Scores {
    n: usize,
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

    /// Scores of n x n rasters, read from transforms of `size` a side.
    pub fn new(n: usize, reach: usize, size: usize) -> Self {
        let around = Self::around(reach) as isize;
        let wrapped: Arc<[usize]> = (-around..=around)
            .map(|s| s.rem_euclid(size as isize) as usize)
            .collect();
        Self {
            n,
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
            Overlap::Area => self.normalise_area(),
            // A shift by s drops the first s rows of g' and the last s rows of f.
            Overlap::Energy => {
                kernels::divide_by_share(&mut self.values, &later.left, &turned.left, energy)
            }
        }
    }

    fn normalise_area(&mut self) {
        let side = self.wrapped.len();
        let around = (side / 2) as isize;
        for (k, score) in self.values.iter_mut().enumerate() {
            let (down, right) = ((k / side) as isize - around, (k % side) as isize - around);
            let share = area_share(self.n, down, right);
            *score = if share > MIN_SHARE {
                (f64::from(*score) / share) as f32
            } else {
                0.0
            };
        }
    }

    /// The score at a shift of (down, right) cells, within `reach + SUPPORT`.
    fn at(&self, down: isize, right: isize) -> f64 {
        let side = self.wrapped.len() as isize;
        let around = side / 2;
        f64::from(self.values[((down + around) * side + right + around) as usize])
    }

    fn scored(&self) -> impl Iterator<Item = (Shift, f64)> + Clone {
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

    pub fn peak(&self, kind: Peak, best: Shift) -> PlanePeak {
        plane_peak(kind, |i, j| self.at(best.0 + i, best.1 + j))
    }

    pub fn place(&self, kind: Peak, best: Shift, peak: &PlanePeak) -> Vector2<f64> {
        match kind {
            Peak::SoftArgmax { temperature } => {
                let scored = self
                    .scored()
                    .map(|((i, j), score)| ([i as f64, j as f64], score));
                Vector2::from(soft_argmax(temperature, self.at(best.0, best.1), scored))
            }
            _ => Vector2::new(best.0 as f64, best.1 as f64) + peak.offset,
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

pub(crate) fn check_side(n: usize) -> Result<(), ConfigError> {
    Section("raster").within("n", n, 16..=8192, "16 to 8192 cells a side")
}

pub(crate) fn check_raster(n: usize, cell_m: f64) -> Result<(), ConfigError> {
    check_side(n)?;
    Section("raster").require(positive(cell_m), "cell_m", &cell_m, "metres, above 0")
}

/// The largest shift of a search over rasters of `n` x `n` cells of `cell_m` metres, cells.
pub(crate) fn reach_cells(
    n: usize,
    cell_m: f64,
    section: &'static str,
    reach_m: f64,
) -> Result<usize, ConfigError> {
    check_raster(n, cell_m)?;
    let reach = (reach_m / cell_m + 1e-9).floor();
    let fits = reach >= 1.0 && reach <= (n / 2 - SUPPORT) as f64;
    let bounds = "at least one cell, less than half the raster";
    Section(section).require(fits, "reach_m", &reach_m, bounds)?;
    Ok(reach as usize)
}

/// Share of the cells that overlap at a shift.
fn area_share(n: usize, down: isize, right: isize) -> f64 {
    let along = |s: isize| 1.0 - s.unsigned_abs() as f64 / n as f64;
    along(down) * along(right)
}
