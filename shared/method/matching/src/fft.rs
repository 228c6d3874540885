//! Two-dimensional transforms that skip rows and columns that are not needed.
//!
//! A plane in the frequency domain is kept column by column ([`Columns`]), so that the second pass
//! runs over contiguous memory. Rows go there in blocks of one cache line.

use std::sync::Arc;

use gyre_radar::fourier::{Complex32, ComplexToReal, Fft, FftDirection};

use crate::kernels;

/// Rows that are transposed together: their values of one column fill a cache line.
pub(crate) const BLOCK: usize = 8;

/// Returns the fastest even transform size of at least `min`, among products of small primes.
///
/// Factors 2 and 3 take about the same time per point, 5 and 11 a quarter more, 7 and other primes
/// more than padding.
pub fn fast_size(min: usize) -> usize {
    let cost = |n: usize| n as f64 * if only_factors(n, &[2, 3]) { 1.0 } else { 1.25 };
    let min = min.max(8);
    (min..=2 * min)
        .filter(|&n| n.is_multiple_of(2) && only_factors(n, &[2, 3, 5, 11]))
        .min_by(|&a, &b| cost(a).total_cmp(&cost(b)))
        .unwrap_or(min.next_power_of_two())
}

fn only_factors(n: usize, factors: &[usize]) -> bool {
    let rest = factors.iter().fold(n, |mut n, &f| {
        while n.is_multiple_of(f) {
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
    /// Distance between columns: an odd number of cache lines, so that a row's values do not all
    /// fall into one cache set.
    stride: usize,
}

impl Columns {
    pub fn new(count: usize, len: usize) -> Self {
        let stride = (len.div_ceil(BLOCK) | 1) * BLOCK;
        Self {
            data: vec![Complex32::default(); count * stride],
            len,
            stride,
        }
    }

    pub fn column(&self, c: usize) -> &[Complex32] {
        &self.data[c * self.stride..][..self.len]
    }

    pub fn column_mut(&mut self, c: usize) -> &mut [Complex32] {
        &mut self.data[c * self.stride..][..self.len]
    }

    fn first_mut(&mut self, count: usize) -> &mut [Complex32] {
        &mut self.data[..count * self.stride]
    }

    pub fn count(&self) -> usize {
        self.data.len() / self.stride
    }

    /// Writes a block of transformed rows, `width` apart in `block`, as rows `first..` of every
    /// column.
    fn write_rows(&mut self, first: usize, rows: usize, block: &[Complex32], width: usize) {
        for (c, column) in self.data.chunks_exact_mut(self.stride).enumerate() {
            for (r, out) in column[first..first + rows].iter_mut().enumerate() {
                *out = block[r * width + c];
            }
        }
    }

    pub fn read_rows(
        &self,
        rows: impl Iterator<Item = usize> + Clone,
        block: &mut [Complex32],
        width: usize,
    ) {
        for (c, column) in self.data.chunks_exact(self.stride).take(width).enumerate() {
            for (r, row) in rows.clone().enumerate() {
                block[r * width + c] = column[row];
            }
        }
    }

    pub fn clear_from(&mut self, first: usize) {
        for column in self.data.chunks_exact_mut(self.stride) {
            column[first..].fill(Complex32::default());
        }
    }
}

pub(crate) struct Transform {
    fft: Arc<dyn Fft<f32>>,
    scratch: Vec<Complex32>,
}

impl Transform {
    pub fn new(size: usize, direction: FftDirection) -> Self {
        let fft = gyre_radar::fourier::complex(size, direction);
        let scratch = fft
            .get_inplace_scratch_len()
            .max(fft.get_immutable_scratch_len());
        Self {
            fft,
            scratch: vec![Complex32::default(); scratch],
        }
    }

    pub fn line_into(&mut self, line: &[Complex32], out: &mut [Complex32]) {
        self.fft
            .process_immutable_with_scratch(line, out, &mut self.scratch);
    }

    pub fn lines(&mut self, lines: &mut [Complex32]) {
        self.fft.process_with_scratch(lines, &mut self.scratch);
    }

    fn columns(&mut self, plane: &mut Columns, count: usize) {
        for c in 0..count {
            self.lines(plane.column_mut(c));
        }
    }
}

pub(crate) struct RowPass {
    row: Transform,
    block: Vec<Complex32>,
}

impl RowPass {
    pub fn new(size: usize) -> Self {
        let row = Transform::new(size, FftDirection::Forward);
        Self {
            row,
            block: vec![Complex32::default(); BLOCK * size],
        }
    }

    /// Transforms `rows` rows into the first ones of `plane`; `fill(r, row)` writes the start of
    /// row r, the rest is zero.
    pub fn forward(
        &mut self,
        plane: &mut Columns,
        rows: usize,
        mut fill: impl FnMut(usize, &mut [Complex32]),
    ) {
        let size = plane.len;
        for first in (0..rows).step_by(BLOCK) {
            let some = BLOCK.min(rows - first);
            let block = &mut self.block[..some * size];
            block.fill(Complex32::default());
            for (r, row) in block.chunks_exact_mut(size).enumerate() {
                fill(first + r, row);
            }
            self.row.lines(block);
            plane.write_rows(first, some, block, size);
        }
    }
}

/// Transform of two real lines at once: of g + i h, whose halves are then separated.
///
/// Faster than `realfft`, which separates the halves of a single line without vector instructions.
pub(crate) struct RealLines {
    transform: Transform,
    lines: [Vec<f32>; 2],
    both: Vec<Complex32>,
}

impl RealLines {
    pub fn new(size: usize) -> Self {
        Self {
            transform: Transform::new(size, FftDirection::Forward),
            lines: [vec![0.0; size], vec![0.0; size]],
            both: vec![Complex32::default(); size],
        }
    }

    /// Transforms the lines that `fill(0, line)` and `fill(1, line)` write into lines of zeros, and
    /// keeps the first harmonics of each, as many as there is room for. Without room for the second
    /// one it is not asked for.
    pub fn forward(
        &mut self,
        mut fill: impl FnMut(usize, &mut [f32]),
        [first, second]: [&mut [Complex32]; 2],
    ) {
        for (k, line) in self.lines.iter_mut().enumerate() {
            line.fill(0.0);
            if k == 0 || !second.is_empty() {
                fill(k, line);
            }
        }
        kernels::interleave(&self.lines[0], &self.lines[1], &mut self.both);
        self.transform.lines(&mut self.both);
        kernels::separate(&self.both, first, second);
    }
}

/// Spectrum of a real square image, only the columns of its low frequencies.
pub(crate) struct RealSpectrum {
    rows: RealLines,
    columns: Transform,
    block: Vec<Complex32>,
    /// Column c holds column frequency c; its row k holds row frequency k (k - size beyond the
    /// middle).
    pub plane: Columns,
}

impl RealSpectrum {
    /// Transform of `size` a side that keeps the column frequencies below `kept`, at most size /
    /// 2 + 1.
    pub fn new(size: usize, kept: usize) -> Self {
        Self {
            rows: RealLines::new(size),
            columns: Transform::new(size, FftDirection::Forward),
            block: vec![Complex32::default(); BLOCK * kept],
            plane: Columns::new(kept, size),
        }
    }

    /// Transforms `rows` rows of an image; `fill(r, row)` writes the start of row r, the rest is
    /// zero.
    pub fn forward(&mut self, rows: usize, mut fill: impl FnMut(usize, &mut [f32])) {
        let kept = self.plane.count();
        for first in (0..rows).step_by(BLOCK) {
            let some = BLOCK.min(rows - first);
            let pairs = self.block[..some * kept].chunks_mut(2 * kept);
            for (k, pair) in pairs.enumerate() {
                let (upper, lower) = pair.split_at_mut(kept);
                self.rows
                    .forward(|r, row| fill(first + 2 * k + r, row), [upper, lower]);
            }
            self.plane.write_rows(first, some, &self.block, kept);
        }
        self.plane.clear_from(rows);
        self.columns.columns(&mut self.plane, kept);
    }
}

/// Spectra of two real square images by one complex transform, and the inverse for some rows.
pub(crate) struct PairSpectrum {
    pub size: usize,
    rows: RowPass,
    columns: Transform,
    inverse_columns: Transform,
    inverse_row: Arc<dyn ComplexToReal<f32>>,
    block: Vec<Complex32>,
    scratch: Vec<Complex32>,
    real: Vec<f32>,
    /// Spectrum of first + i second; after [`cross`](Self::cross) the cross-spectrum in columns 0
    /// to size / 2.
    plane: Columns,
    /// The column of the opposite frequency: columns 0 and size / 2 are their own, and are
    /// overwritten as they are read.
    mirror: Vec<Complex32>,
}

impl PairSpectrum {
    /// Transforms of `size` (even) a side.
    pub fn new(size: usize) -> Self {
        let inverse_row = gyre_radar::fourier::real_inverse(size);
        Self {
            size,
            rows: RowPass::new(size),
            columns: Transform::new(size, FftDirection::Forward),
            inverse_columns: Transform::new(size, FftDirection::Inverse),
            scratch: inverse_row.make_scratch_vec(),
            inverse_row,
            block: vec![Complex32::default(); BLOCK * (size / 2 + 1)],
            real: vec![0.0; size],
            plane: Columns::new(size, size),
            mirror: vec![Complex32::default(); size],
        }
    }

    /// Transforms `rows` rows; `fill(r, row)` writes first + i second to the start of row r, the
    /// rest is zero.
    pub fn forward(&mut self, rows: usize, fill: impl FnMut(usize, &mut [Complex32])) {
        self.rows.forward(&mut self.plane, rows, fill);
        self.plane.clear_from(rows);
        self.columns.columns(&mut self.plane, self.size);
    }

    /// Turns the pair's spectrum into second x conj(first), column by column.
    ///
    /// With Z = F + iG of two real images, Z(k) and Z(-k) separate F and G:
    /// G conj(F) = Im(Z(k) Z(-k)) / 2 - i (|Z(k)|^2 - |Z(-k)|^2) / 4.
    pub fn cross(&mut self) {
        for c in 0..=self.size / 2 {
            self.mirror
                .copy_from_slice(self.plane.column((self.size - c) % self.size));
            let (head, tail) = self.plane.column_mut(c).split_at_mut(1);
            kernels::cross_of_pair(head, &self.mirror[..1]);
            kernels::cross_of_pair(tail, &self.mirror[1..]);
        }
    }

    pub fn cross_spectrum_mut(&mut self) -> &mut [Complex32] {
        self.plane.first_mut(self.size / 2 + 1)
    }

    /// Transforms back to the image domain: calls `take(r, row)` for each r of `rows` with the
    /// whole row `rows[r]`, not scaled.
    pub fn inverse(&mut self, rows: &[usize], mut take: impl FnMut(usize, &[f32])) {
        let width = self.size / 2 + 1;
        self.inverse_columns.columns(&mut self.plane, width);
        for (b, some) in rows.chunks(BLOCK).enumerate() {
            self.plane
                .read_rows(some.iter().copied(), &mut self.block, width);
            for (r, half) in self
                .block
                .chunks_exact_mut(width)
                .take(some.len())
                .enumerate()
            {
                half[0].im = 0.0;
                half[width - 1].im = 0.0;
                let done =
                    self.inverse_row
                        .process_with_scratch(half, &mut self.real, &mut self.scratch);
                debug_assert!(done.is_ok(), "lengths are those of the plan");
                take(b * BLOCK + r, &self.real);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn fast_sizes_have_small_factors_and_waste_little() {
        for min in 2..3000 {
            let size = fast_size(min);
            let is_fast = size.is_multiple_of(2) && only_factors(size, &[2, 3, 5, 11]);
            assert!(size >= min && is_fast, "{min}: {size}");
            assert!(size * 3 <= min * 4 || min < 16, "{min}: {size}");
        }
        let sizes = [255, 288, 511, 544].map(fast_size);
        assert_eq!(sizes, [256, 288, 512, 576]);
    }

    #[test]
    fn real_spectrum_equals_a_direct_sum() {
        let (n, size, kept) = (11, 16, 5);
        let image: Vec<f32> = (0..n * n).map(|k| ((k * 29) % 13) as f32).collect();
        let mut spectrum = RealSpectrum::new(size, kept);
        spectrum.forward(n, |r, out| {
            out[..n].copy_from_slice(&image[r * n..(r + 1) * n])
        });
        for c in 0..kept {
            for k in 0..size {
                let direct: Complex32 = (0..n * n)
                    .map(|i| {
                        let turns = ((i / n) * k + (i % n) * c) as f32 / size as f32;
                        Complex32::from_polar(image[i], -std::f32::consts::TAU * turns)
                    })
                    .sum();
                assert!(
                    (spectrum.plane.column(c)[k] - direct).norm() < 0.01,
                    "{c} {k}"
                );
            }
        }
    }
}
