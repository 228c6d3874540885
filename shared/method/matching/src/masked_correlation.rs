use gyre_geometry::Pose;
use gyre_simd::simd;
use nalgebra::{Point2, Vector2};
use ndarray::ArrayView2;

use crate::{SettingError, ShapeError, cells, scores::check_raster, warp::Rotation};

/// The masked normalised correlation of two rasters at one motion, over the cells that lie within a
/// range of both sensors.
#[derive(Debug)]
pub struct MaskedCorrelation {
    n: usize,
    cell_m: f64,
    range_m: f64,
    /// A row of the earlier raster as seen from the later frame.
    row: Vec<f32>,
}

/// The squared distance of a row's cells from a sensor, which is a parabola along the row.
#[derive(Clone, Copy)]
struct Disc {
    first: [f32; 2],
    step: [f32; 2],
    range2: f32,
}

/// Sums of f^2, g^2 and f g.
type Sums = [f32; 3];

impl MaskedCorrelation {
    /// Plans correlations of rasters of `n` x `n` cells of `cell_m` metres within `range_m` of both
    /// sensors.
    pub fn new(n: usize, cell_m: f64, range_m: f64) -> Result<Self, SettingError> {
        check_raster(n, cell_m)?;
        Ok(Self {
            n,
            cell_m,
            range_m,
            row: vec![0.0; n],
        })
    }

    /// Returns the sum of f(x) g(R x + t) over the root of the product of the sums of the squares,
    /// where (R, t) is the `motion` from the earlier raster g to the later one f, and both x and R
    /// x + t are within range; 0 without energy there. Of the later raster only those cells count
    /// that its sensor could see: `seen` is 1 there, and 0 elsewhere.
    pub fn at(
        &mut self,
        later: ArrayView2<'_, f32>,
        earlier: ArrayView2<'_, f32>,
        seen: Option<ArrayView2<'_, f32>>,
        motion: &Pose,
    ) -> Result<f64, ShapeError> {
        let seen = seen.as_ref().map(|seen| cells("seen cells", seen, self.n));
        let seen = seen.transpose()?;
        let later = cells("later raster", &later, self.n)?;
        let earlier = cells("earlier raster", &earlier, self.n)?;
        let shift = motion.translation.vector / -self.cell_m;
        let warp = Rotation::new(self.n, motion.rotation.angle()).with_offset(shift.into());
        let mut total = [0.0_f64; 3];
        for (r, f) in later.chunks_exact(self.n).enumerate() {
            warp.row(earlier, r, &mut self.row);
            if let Some(seen) = seen {
                keep_seen(&mut self.row, &seen[r * self.n..][..self.n]);
            }
            let sums = sum_row(f, &self.row, &self.discs(r, motion));
            total
                .iter_mut()
                .zip(sums)
                .for_each(|(total, sum)| *total += f64::from(sum));
        }
        let [ff, gg, fg] = total;
        let correlation = fg / (ff * gg).sqrt();
        Ok(if correlation.is_finite() {
            correlation
        } else {
            0.0
        })
    }

    /// The discs of both sensors along row `r`, in the frames of the later and of the earlier
    /// raster, cells.
    fn discs(&self, r: usize, motion: &Pose) -> [Disc; 2] {
        let middle = (self.n - 1) as f64 / 2.0;
        let first = Point2::new(middle - r as f64, middle);
        let step = Vector2::new(0.0, -1.0);
        let there = motion.rotation * first + motion.translation.vector / self.cell_m;
        let range2 = ((self.range_m / self.cell_m).powi(2)) as f32;
        let disc = |first: Point2<f64>, step: Vector2<f64>| Disc {
            first: [first.x as f32, first.y as f32],
            step: [step.x as f32, step.y as f32],
            range2,
        };
        [disc(first, step), disc(there, motion.rotation * step)]
    }
}

impl Disc {
    #[inline(always)]
    fn contains(&self, k: f32) -> bool {
        let (x, y) = (
            self.first[0] + k * self.step[0],
            self.first[1] + k * self.step[1],
        );
        x * x + y * y < self.range2
    }
}

/// Leaves a row as it is where `seen` is 1, and empty where it is 0.
pub(crate) fn keep_seen(row: &mut [f32], seen: &[f32]) {
    row.iter_mut()
        .zip(seen)
        .for_each(|(cell, seen)| *cell *= seen);
}

#[simd]
fn sum_row(f: &[f32], g: &[f32], discs: &[Disc; 2]) -> Sums {
    const LANES: usize = 16;
    let mut lanes = [[0.0_f32; LANES]; 3];
    for (block, (f, g)) in f.chunks(LANES).zip(g.chunks(LANES)).enumerate() {
        for (k, (&f, &g)) in f.iter().zip(g).enumerate() {
            let at = (block * LANES + k) as i32 as f32;
            let seen = discs[0].contains(at) & discs[1].contains(at);
            let (f, g) = if seen { (f, g) } else { (0.0, 0.0) };
            lanes[0][k] += f * f;
            lanes[1][k] += g * g;
            lanes[2][k] += f * g;
        }
    }
    lanes.map(|lane| lane.iter().sum())
}

#[cfg(test)]
mod tests {
    use gyre_geometry::pose;
    use ndarray::Array2;
    use proptest::prelude::*;

    use super::*;

    const N: usize = 21;
    const CELL_M: f64 = 0.5;

    /// The same by bilinear lookups, cell by cell.
    fn direct(f: &Array2<f32>, g: &Array2<f32>, motion: &Pose, range_m: f64) -> f64 {
        let mut sums = [0.0; 3];
        for ((r, c), &f) in f.indexed_iter() {
            let here = Point2::new(10.0 - r as f64, 10.0 - c as f64) * CELL_M;
            let there = motion * here;
            if here.coords.norm() >= range_m || there.coords.norm() >= range_m {
                continue;
            }
            let (u, v) = (10.0 - there.x / CELL_M, 10.0 - there.y / CELL_M);
            let (i, j) = (u.floor() as usize, v.floor() as usize);
            let (a, b) = (u - i as f64, v - j as f64);
            let at = |i: usize, j: usize| f64::from(g[[i, j]]);
            let g = (1.0 - a) * ((1.0 - b) * at(i, j) + b * at(i, j + 1))
                + a * ((1.0 - b) * at(i + 1, j) + b * at(i + 1, j + 1));
            let f = f64::from(f);
            sums[0] += f * f;
            sums[1] += g * g;
            sums[2] += f * g;
        }
        sums[2] / (sums[0] * sums[1]).sqrt()
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(64))]
        #[test]
        fn equals_a_direct_sum(
            f in prop::collection::vec(0.0_f32..1.0, N * N),
            g in prop::collection::vec(0.0_f32..1.0, N * N),
            x in -2.0_f64..2.0, y in -2.0_f64..2.0, yaw in -3.1_f64..3.1,
        ) {
            let raster = |cells| Array2::from_shape_vec((N, N), cells).unwrap();
            let (f, g, motion) = (raster(f), raster(g), pose(x, y, yaw));
            let mut correlation = MaskedCorrelation::new(N, CELL_M, 4.61).unwrap();
            let got = correlation.at(f.view(), g.view(), None, &motion).unwrap();
            prop_assert!((got - direct(&f, &g, &motion, 4.61)).abs() < 2e-3, "{got}");
        }
    }

    #[test]
    fn what_could_not_be_seen_does_not_count() {
        let mut numbers = (0..N * N).map(|k| ((k * 7919) % 101) as f32);
        let whole = Array2::from_shape_simple_fn((N, N), || numbers.next().unwrap());
        let seen = Array2::from_shape_fn((N, N), |(_, column)| f32::from(column < N / 2));
        let half = &whole * &seen;
        let mut correlation = MaskedCorrelation::new(N, CELL_M, 100.0).unwrap();
        let (half, still) = (half.view(), Pose::identity());
        let unmasked = correlation.at(half, whole.view(), None, &still).unwrap();
        assert!(unmasked < 0.9, "{unmasked}");
        let masked = correlation.at(half, whole.view(), Some(seen.view()), &still);
        assert!((masked.unwrap() - 1.0).abs() < 1e-6);
        let mut with = |g: Array2<f32>| correlation.at(half, g.view(), None, &still);
        assert_eq!(with(Array2::zeros((N, N))).unwrap(), 0.0);
        assert!(with(Array2::zeros((N, N - 1))).is_err());
    }
}
