//! Two-dimensional transforms that skip what nobody looks at.
//!
//! A plane in the frequency domain is kept column by column ([`Columns`]), so that the second pass runs over
//! contiguous memory. Rows go there in blocks of one cache line.

use std::sync::Arc;

use realfft::{ComplexToReal, RealFftPlanner, RealToComplex};
use rustfft::{Fft, FftDirection, FftPlanner, num_complex::Complex32};

/// Rows that are transposed together: their complex values of one column fill a cache line.
const BLOCK: usize = 8;

/// The fastest even transform size of at least `least`, among products of small primes.
///
/// Factors 2 and 3 cost about the same a point, 5 and 11 a quarter more, 7 and other primes more than padding does.
pub fn fast_size(least: usize) -> usize {
    let cost = |n: usize| n as f64 * if only_factors(n, &[2, 3]) { 1.0 } else { 1.25 };
    let least = least.max(8);
    (least..=2 * least)
        .filter(|&n| n % 2 == 0 && only_factors(n, &[2, 3, 5, 11]))
        .min_by(|&a, &b| cost(a).total_cmp(&cost(b)))
        .unwrap_or(least.next_power_of_two())
}

fn only_factors(n: usize, factors: &[usize]) -> bool {
    let rest = factors.iter().fold(n, |mut n, &f| {
        while n % f == 0 {
            n /= f;
        }
        n
    });
    rest == 1
}

/// A plane kept column by column, each column `len` long.
#[derive(Debug, Clone)]
pub(crate) struct Columns {
    pub data: Vec<Complex32>,
    pub len: usize,
    /// Distance between columns: an odd number of cache lines, so that a row's values do not all fall into one cache set.
    stride: usize,
}

impl Columns {
    pub fn new(count: usize, len: usize) -> Self {
        let stride = (len.div_ceil(BLOCK) | 1) * BLOCK;
        Self { data: vec![Complex32::default(); count * stride], len, stride }
    }

    pub fn column(&self, c: usize) -> &[Complex32] {
        &self.data[c * self.stride..][..self.len]
    }

    pub fn column_mut(&mut self, c: usize) -> &mut [Complex32] {
        &mut self.data[c * self.stride..][..self.len]
    }

    pub fn count(&self) -> usize {
        self.data.len() / self.stride
    }

    /// Writes a block of transformed rows, `width` apart in `block`, as rows `first..` of every column.
    fn write_rows(&mut self, first: usize, rows: usize, block: &[Complex32], width: usize) {
        for (c, column) in self.data.chunks_exact_mut(self.stride).enumerate() {
            for (r, out) in column[first..first + rows].iter_mut().enumerate() {
                *out = block[r * width + c];
            }
        }
    }

    /// Reads the first `width` values of the rows named in `rows` into `block`, row after row.
    fn read_rows(&self, rows: &[usize], block: &mut [Complex32], width: usize) {
        for (c, column) in self.data.chunks_exact(self.stride).take(width).enumerate() {
            for (r, &row) in rows.iter().enumerate() {
                block[r * width + c] = column[row];
            }
        }
    }

    /// Sets rows `first..` of every column to zero.
    fn clear_from(&mut self, first: usize) {
        for column in self.data.chunks_exact_mut(self.stride) {
            column[first..].fill(Complex32::default());
        }
    }
}

/// One-dimensional complex transform with its scratch.
struct Transform {
    fft: Arc<dyn Fft<f32>>,
    scratch: Vec<Complex32>,
}

impl Transform {
    fn new(planner: &mut FftPlanner<f32>, size: usize, direction: FftDirection) -> Self {
        let fft = planner.plan_fft(size, direction);
        let scratch = vec![Complex32::default(); fft.get_inplace_scratch_len()];
        Self { fft, scratch }
    }

    /// Transforms the first `count` columns.
    fn columns(&mut self, plane: &mut Columns, count: usize) {
        for c in 0..count {
            self.fft.process_with_scratch(plane.column_mut(c), &mut self.scratch);
        }
    }
}

/// Spectrum of a real square image, only the columns of its low frequencies.
pub(crate) struct RealSpectrum {
    size: usize,
    row: Arc<dyn RealToComplex<f32>>,
    columns: Transform,
    real: Vec<f32>,
    block: Vec<Complex32>,
    scratch: Vec<Complex32>,
    /// Column c holds column frequency c; its row k holds row frequency k (k - size beyond the middle).
    pub plane: Columns,
}

impl RealSpectrum {
    /// Transform of `size` a side that keeps the column frequencies below `kept`.
    pub fn new(size: usize, kept: usize) -> Self {
        let row = RealFftPlanner::new().plan_fft_forward(size);
        Self {
            size,
            columns: Transform::new(&mut FftPlanner::new(), size, FftDirection::Forward),
            real: vec![0.0; size],
            block: vec![Complex32::default(); BLOCK * (size / 2 + 1)],
            scratch: row.make_scratch_vec(),
            row,
            plane: Columns::new(kept, size),
        }
    }

    /// Transforms `rows` rows of an image; `fill(r, row)` writes the start of row r, the rest is zero.
    pub fn forward(&mut self, rows: usize, mut fill: impl FnMut(usize, &mut [f32])) {
        let width = self.size / 2 + 1;
        for first in (0..rows).step_by(BLOCK) {
            let some = BLOCK.min(rows - first);
            for (r, out) in self.block.chunks_exact_mut(width).take(some).enumerate() {
                self.real.fill(0.0);
                fill(first + r, &mut self.real);
                let done = self.row.process_with_scratch(&mut self.real, out, &mut self.scratch);
                debug_assert!(done.is_ok(), "lengths are those of the plan");
            }
            self.plane.write_rows(first, some, &self.block, width);
        }
        self.plane.clear_from(rows);
        let kept = self.plane.count();
        self.columns.columns(&mut self.plane, kept);
    }
}

/// Spectra of two real square images by one complex transform, and the way back for some rows.
pub(crate) struct PairSpectrum {
    size: usize,
    row: Transform,
    columns: Transform,
    inverse_columns: Transform,
    inverse_row: Arc<dyn ComplexToReal<f32>>,
    block: Vec<Complex32>,
    real: Vec<f32>,
    /// Spectrum of first + i second; after [`cross`](Self::cross) the cross-spectrum in columns 0 to size / 2.
    plane: Columns,
    /// The first half of a column that is its own mirror image, kept while it is overwritten.
    mirror: Vec<Complex32>,
}

impl PairSpectrum {
    /// Transforms of `size` (even) a side.
    pub fn new(size: usize) -> Self {
        let mut planner = FftPlanner::new();
        let inverse_row = RealFftPlanner::new().plan_fft_inverse(size);
        let mut row = Transform::new(&mut planner, size, FftDirection::Forward);
        row.scratch.resize(row.scratch.len().max(inverse_row.get_scratch_len()), Complex32::default());
        Self {
            size,
            row,
            columns: Transform::new(&mut planner, size, FftDirection::Forward),
            inverse_columns: Transform::new(&mut planner, size, FftDirection::Inverse),
            inverse_row,
            block: vec![Complex32::default(); BLOCK * size],
            real: vec![0.0; size],
            plane: Columns::new(size, size),
            mirror: vec![Complex32::default(); size],
        }
    }

    /// Cells a side.
    pub fn size(&self) -> usize {
        self.size
    }

    /// Transforms `rows` rows; `fill(r, row)` writes first + i second to the start of row r, the rest is zero.
    pub fn forward(&mut self, rows: usize, mut fill: impl FnMut(usize, &mut [Complex32])) {
        for first in (0..rows).step_by(BLOCK) {
            let some = BLOCK.min(rows - first);
            let block = &mut self.block[..some * self.size];
            block.fill(Complex32::default());
            for (r, row) in block.chunks_exact_mut(self.size).enumerate() {
                fill(first + r, row);
            }
            self.row.fft.process_with_scratch(block, &mut self.row.scratch);
            self.plane.write_rows(first, some, block, self.size);
        }
        self.plane.clear_from(rows);
        self.columns.columns(&mut self.plane, self.size);
    }

    /// Turns the pair's spectrum into `finish(second x conj(first))`, column by column.
    ///
    /// With Z = F + iG of two real images, F and G fall apart by Z(k) and Z(-k):
    /// G conj(F) = Im(Z(k) Z(-k)) / 2 - i (|Z(k)|^2 - |Z(-k)|^2) / 4.
    pub fn cross(&mut self, finish: impl Fn(Complex32) -> Complex32) {
        for c in 0..=self.size / 2 {
            self.mirror.copy_from_slice(self.plane.column((self.size - c) % self.size));
            let column = self.plane.column_mut(c);
            let (head, tail) = (self.mirror[0], self.mirror[1..].iter().rev());
            for (z, &m) in column.iter_mut().zip(std::iter::once(&head).chain(tail)) {
                let cross = Complex32::new(0.5 * (*z * m).im, 0.25 * (m.norm_sqr() - z.norm_sqr()));
                *z = finish(cross);
            }
        }
    }

    /// Back to the image domain: calls `take(r, row)` for each r of `rows`, with the whole row `rows[r]`, not scaled.
    pub fn inverse(&mut self, rows: &[usize], mut take: impl FnMut(usize, &[f32])) {
        let width = self.size / 2 + 1;
        self.inverse_columns.columns(&mut self.plane, width);
        for (b, some) in rows.chunks(BLOCK).enumerate() {
            self.plane.read_rows(some, &mut self.block, width);
            for (r, half) in self.block.chunks_exact_mut(width).take(some.len()).enumerate() {
                half[0].im = 0.0;
                half[width - 1].im = 0.0;
                let done = self.inverse_row.process_with_scratch(half, &mut self.real, &mut self.row.scratch);
                debug_assert!(done.is_ok(), "lengths are those of the plan");
                take(b * BLOCK + r, &self.real);
            }
        }
    }
}
