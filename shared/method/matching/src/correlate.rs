//! Correlations of many images with one whose spectrum is kept.

use std::sync::Arc;

use gyre_radar::fourier::{Complex32, FftDirection};

use crate::{
    fft::{BLOCK, Columns, RowPass, Transform},
    kernels,
};

/// Correlates real images, two at a time, with a kept one.
///
/// With Z the spectrum of g + i h, the inverse transform of Z conj(F) has the correlation of f with
/// g as its real part and the correlation of f with h as its imaginary part: one complex transform
/// computes both without separating them.
pub(crate) struct KeptCorrelation {
    n: usize,
    size: usize,
    shifts: Arc<[usize]>,
    rows: RowPass,
    columns: Transform,
    inverse_columns: Transform,
    inverse_row: Transform,
    block: Vec<Complex32>,
    /// Column by column: the transformed rows above zeros; the conjugate spectrum of the kept
    /// image; the wanted shifts.
    plane: Columns,
    kept: Columns,
    wanted: Columns,
    column: Vec<Complex32>,
}

impl KeptCorrelation {
    /// Plans correlations of n x n images by transforms of `size` a side. `shifts` are the rows of
    /// the transform to keep.
    pub fn new(n: usize, size: usize, shifts: Arc<[usize]>) -> Self {
        Self {
            n,
            size,
            rows: RowPass::new(size),
            columns: Transform::new(size, FftDirection::Forward),
            inverse_columns: Transform::new(size, FftDirection::Inverse),
            inverse_row: Transform::new(size, FftDirection::Inverse),
            block: vec![Complex32::default(); BLOCK * size],
            plane: Columns::new(size, size),
            kept: Columns::new(size, size),
            wanted: Columns::new(size, shifts.len()),
            column: vec![Complex32::default(); size],
            shifts,
        }
    }

    pub fn scale(&self) -> f64 {
        1.0 / (self.size * self.size) as f64
    }

    pub fn keep(&mut self, f: &[f32]) {
        let n = self.n;
        self.rows.forward(&mut self.kept, n, |r, out| {
            out.iter_mut()
                .zip(&f[r * n..][..n])
                .for_each(|(z, &f)| z.re = f);
        });
        self.kept.clear_from(n);
        for c in 0..self.size {
            let column = self.kept.column_mut(c);
            self.columns.lines(column);
            column.iter_mut().for_each(|z| z.im = -z.im);
        }
    }

    /// C(s) = sum of f(x) g(x + s), and the same of h: calls `take(r, row)` for the r-th of the
    /// shifts down with all shifts to the right, g's in the real parts and h's in the imaginary
    /// ones, not scaled.
    pub fn correlate(&mut self, [g, h]: [&[f32]; 2], mut take: impl FnMut(usize, &[Complex32])) {
        let (n, size) = (self.n, self.size);
        self.rows.forward(&mut self.plane, n, |r, out| {
            kernels::interleave(&g[r * n..][..n], &h[r * n..][..n], out);
        });
        for c in 0..size {
            // Forward and back while the column is in the nearest cache; few of its values are
            // kept.
            self.columns
                .line_into(self.plane.column(c), &mut self.column);
            kernels::multiply(&mut self.column, self.kept.column(c));
            self.inverse_columns.lines(&mut self.column);
            self.wanted
                .column_mut(c)
                .iter_mut()
                .zip(&*self.shifts)
                .for_each(|(z, &row)| *z = self.column[row]);
        }
        for first in (0..self.shifts.len()).step_by(BLOCK) {
            let some = BLOCK.min(self.shifts.len() - first);
            let block = &mut self.block[..some * size];
            self.wanted.read_rows(first..first + some, block, size);
            self.inverse_row.lines(block);
            block
                .chunks_exact(size)
                .enumerate()
                .for_each(|(r, row)| take(first + r, row));
        }
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(24))]
        #[test]
        fn both_correlations_equal_their_direct_sums(
            n in 4_usize..14,
            values in prop::collection::vec(0.0_f32..1.0, 3 * 14 * 14),
        ) {
            let images: Vec<&[f32]> = values.chunks_exact(14 * 14).map(|image| &image[..n * n]).collect();
            let reach = (n / 2) as isize;
            let size = crate::fast_size(n + n / 2) as isize;
            let rows: Arc<[usize]> = (-reach..=reach).map(|s| s.rem_euclid(size) as usize).collect();
            let mut correlation = KeptCorrelation::new(n, size as usize, rows.clone());
            let mut found = Vec::new();
            correlation.keep(images[0]);
            correlation.correlate([images[1], images[2]], |_, row| {
                found.extend(rows.iter().map(|&c| row[c] / (size * size) as f32));
            });
            for (k, value) in found.iter().enumerate() {
                let (down, right) = ((k / rows.len()) as isize - reach, (k % rows.len()) as isize - reach);
                let inside = |v: isize| (0..n as isize).contains(&v);
                let direct = |g: &[f32]| -> f32 {
                    (0..n * n)
                        .filter_map(|i| {
                            let (row, col) = ((i / n) as isize + down, (i % n) as isize + right);
                            (inside(row) && inside(col)).then(|| images[0][i] * g[row as usize * n + col as usize])
                        })
                        .sum()
                };
                for (got, want) in [(value.re, direct(images[1])), (value.im, direct(images[2]))] {
                    prop_assert!((got - want).abs() < 1e-3, "{down} {right}: {got} {want}");
                }
            }
        }
    }
}
