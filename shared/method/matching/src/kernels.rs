//! The inner loops, compiled for several vector units; the variant for the processor is chosen at
//! run time.

// Bilinear lookups read at computed positions, without checks and two neighbours at a time. Every
// position is clamped to the image right before it is read.
#![allow(unsafe_code)]

use gyre_radar::fourier::Complex32;
use gyre_simd::simd;

/// Number of partial sums, so that a sum can be vectorised.
const LANES: usize = 16;

/// If less than this share of two rasters overlaps, the score is set to zero.
const MIN_SHARE: f64 = 1e-3;

/// The position of a sample among four neighbours: the first of them and the weights toward the
/// others.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Bilinear {
    /// Index of the first neighbour; the others are 1, a row, and a row and 1 behind it.
    pub at: u32,
    /// Weight toward the neighbour 1 behind.
    pub along: f32,
    /// Weight toward the neighbours a row behind.
    pub across: f32,
}

const CHUNK: usize = 64;

/// The four neighbours of a chunk of samples, pair by pair: first in the first row, then a row
/// behind.
struct Neighbours([[[f32; 2]; CHUNK]; 2]);

impl Neighbours {
    const NONE: Self = Self([[[0.0; 2]; CHUNK]; 2]);

    /// Reads the neighbours of the samples whose first is at `places`.
    ///
    /// # Safety
    /// Each place plus `stride + 1` must lie in the image.
    // Not inlined: compiled for wider vectors this loop becomes gathers, which take longer than
    // single reads.
    #[inline(never)]
    unsafe fn read(&mut self, image: &[f32], stride: usize, places: &[u32]) {
        let [first, second] = &mut self.0;
        for ((first, second), &at) in first.iter_mut().zip(second).zip(places) {
            // SAFETY: the caller guarantees the last of the four indices; the others are smaller.
            unsafe {
                let here = image.as_ptr().add(at as usize);
                *first = here.cast::<[f32; 2]>().read();
                *second = here.add(stride).cast::<[f32; 2]>().read();
            }
        }
    }

    #[inline(always)]
    fn value(&self, k: usize, along: f32, across: f32) -> f32 {
        let [[a, b], [c, d]] = [self.0[0][k], self.0[1][k]];
        let first = a + along * (b - a);
        let second = c + along * (d - c);
        first + across * (second - first)
    }
}

/// Bilinear values along a straight line through a square image of `n` a side.
///
/// `start` and `step` are (row, column) in cells. The caller keeps the line within the image; a
/// sample that rounding puts outside is clamped to the edge.
#[simd]
pub(crate) fn bilinear_line(
    image: &[f32],
    n: usize,
    start: [f64; 2],
    step: [f64; 2],
    out: &mut [f32],
) {
    assert!((2..1 << 15).contains(&n) && image.len() >= n * n && out.len() < 1 << 15);
    let last = (n - 2) as f32;
    let [row, col] = start.map(|s| s as f32);
    let [row_step, col_step] = step.map(|s| s as f32);
    let (mut places, mut along, mut across) = ([0; CHUNK], [0.0; CHUNK], [0.0; CHUNK]);
    let mut neighbours = Neighbours::NONE;
    for (c, out) in out.chunks_mut(CHUNK).enumerate() {
        let first = (c * CHUNK) as i32;
        for k in 0..CHUNK {
            let t = (first + k as i32) as f32;
            let (u, v) = (row + t * row_step, col + t * col_step);
            // SAFETY: `max` and `min` leave a number in 0..=n - 2 whatever u and v are, NaN
            // included. The checked conversion takes longer than all the rest.
            let [i, j] = [u, v].map(|w| unsafe { w.max(0.0).min(last).to_int_unchecked::<i32>() });
            places[k] = (i * n as i32 + j) as u32;
            along[k] = v - j as f32;
            across[k] = u - i as f32;
        }
        // SAFETY: i and j are at most n - 2, and the image has n x n cells.
        unsafe { neighbours.read(image, n, &places[..out.len()]) };
        for (k, value) in out.iter_mut().enumerate() {
            *value = neighbours.value(k, along[k], across[k]);
        }
    }
}

#[simd]
pub(crate) fn bilinear_table(image: &[f32], stride: usize, table: &[Bilinear], out: &mut [f32]) {
    assert!(image.len() >= stride + 2 && image.len() < 1 << 31);
    let last = (image.len() - stride - 2) as u32;
    let (mut places, mut neighbours) = ([0; CHUNK], Neighbours::NONE);
    for (table, out) in table.chunks(CHUNK).zip(out.chunks_mut(CHUNK)) {
        for (place, sample) in places.iter_mut().zip(table) {
            *place = sample.at.min(last);
        }
        // SAFETY: each place is at most the image's length less stride + 2.
        unsafe { neighbours.read(image, stride, &places[..table.len()]) };
        for (k, (value, sample)) in out.iter_mut().zip(table).enumerate() {
            *value = neighbours.value(k, sample.along, sample.across);
        }
    }
}

/// Row times taper; values that are not finite count as zero.
#[simd]
pub(crate) fn weigh(row: &[f32], taper: &[f32], out: &mut [f32]) {
    for ((o, &v), &w) in out.iter_mut().zip(row).zip(taper) {
        *o = if v.is_finite() { v * w } else { 0.0 };
    }
}

/// Copies values; those that are not finite become zero.
#[simd]
pub(crate) fn finite_copy(from: &[f32], to: &mut [f32]) {
    for (t, &v) in to.iter_mut().zip(from) {
        *t = if v.is_finite() { v } else { 0.0 };
    }
}

#[simd]
pub(crate) fn add_squares(row: &[f32], sums: &mut [f32]) -> f32 {
    let mut lanes = [0.0; LANES];
    let (mut values, mut sums) = (row.chunks_exact(LANES), sums.chunks_exact_mut(LANES));
    for (v, sum) in values.by_ref().zip(sums.by_ref()) {
        for k in 0..LANES {
            sum[k] += v[k] * v[k];
            lanes[k] += v[k] * v[k];
        }
    }
    for (k, (&v, sum)) in values
        .remainder()
        .iter()
        .zip(sums.into_remainder())
        .enumerate()
    {
        *sum += v * v;
        lanes[k] += v * v;
    }
    lanes.iter().sum()
}

/// Sum of |z|^2.
#[simd]
pub(crate) fn energy(values: &[Complex32]) -> f32 {
    let mut lanes = [0.0; LANES];
    for chunk in values.chunks(LANES) {
        for (lane, z) in lanes.iter_mut().zip(chunk) {
            *lane += z.re * z.re + z.im * z.im;
        }
    }
    lanes.iter().sum()
}

#[simd]
pub(crate) fn modulus(spectrum: &[Complex32], out: &mut [f32]) {
    for (m, z) in out.iter_mut().zip(spectrum) {
        *m = (z.re * z.re + z.im * z.im).sqrt();
    }
}

#[simd]
pub(crate) fn add_cross(f: &[Complex32], g: &[Complex32], cross: &mut [Complex32]) {
    for ((c, f), g) in cross.iter_mut().zip(f).zip(g) {
        c.re += g.re * f.re + g.im * f.im;
        c.im += g.im * f.re - g.re * f.im;
    }
}

#[simd]
pub(crate) fn interleave(g: &[f32], h: &[f32], out: &mut [Complex32]) {
    for ((z, &g), &h) in out.iter_mut().zip(g).zip(h) {
        *z = Complex32::new(g, h);
    }
}

/// The first values of the spectra of g and h from the spectrum of g + i h, by G(k) = conj(G(-k)).
#[simd]
pub(crate) fn separate(both: &[Complex32], g: &mut [Complex32], h: &mut [Complex32]) {
    let (z, m) = (&both[1..], both[1..].iter().rev());
    if let [mean, g @ ..] = g {
        *mean = Complex32::new(both[0].re, 0.0);
        for ((g, z), m) in g.iter_mut().zip(z).zip(m.clone()) {
            *g = Complex32::new(0.5 * (z.re + m.re), 0.5 * (z.im - m.im));
        }
    }
    if let [mean, h @ ..] = h {
        *mean = Complex32::new(both[0].im, 0.0);
        for ((h, z), m) in h.iter_mut().zip(z).zip(m) {
            *h = Complex32::new(0.5 * (z.im + m.im), 0.5 * (m.re - z.re));
        }
    }
}

#[simd]
pub(crate) fn multiply(column: &mut [Complex32], by: &[Complex32]) {
    for (z, w) in column.iter_mut().zip(by) {
        *z = Complex32::new(z.re * w.re - z.im * w.im, z.re * w.im + z.im * w.re);
    }
}

/// Im(z m) / 2 - i (|z|^2 - |m|^2) / 4 in place of z, where `mirror` holds m in reverse order.
#[simd]
pub(crate) fn cross_of_pair(column: &mut [Complex32], mirror: &[Complex32]) {
    for (z, m) in column.iter_mut().zip(mirror.iter().rev()) {
        let re = 0.5 * (z.re * m.im + z.im * m.re);
        let im = 0.25 * (m.re * m.re + m.im * m.im - z.re * z.re - z.im * z.im);
        *z = Complex32::new(re, im);
    }
}

/// Divides each score by the share of `energy` that both rasters have left in the overlap; `f` is
/// in reverse order.
#[simd]
pub(crate) fn divide_by_share(scores: &mut [f32], f: &[f64], g: &[f64], energy: f64) {
    for ((score, &f), &g) in scores.iter_mut().zip(f.iter().rev()).zip(g) {
        let share = (f * g).sqrt() / energy;
        *score = if share > MIN_SHARE {
            (f64::from(*score) / share) as f32
        } else {
            0.0
        };
    }
}

/// ln(1 + scale m) of each value, all at least 0, to 2e-6 relative.
#[simd]
pub(crate) fn log1p_scaled(values: &mut [f32], scale: f32) {
    for m in values {
        *m = ln(1.0 + scale * *m);
    }
}

/// Natural logarithm of a normal number of at least 1, without branches.
///
/// x = 2^e m with m in [sqrt(1/2), sqrt(2)); ln m = 2 atanh((m - 1) / (m + 1)) by its series.
#[inline(always)]
fn ln(x: f32) -> f32 {
    const SQRT_HALF: u32 = 0x3f35_04f3;
    let shifted = x.to_bits().wrapping_sub(SQRT_HALF);
    let exponent = (shifted as i32 >> 23) as f32;
    let m = f32::from_bits((shifted & 0x007f_ffff) + SQRT_HALF);
    let t = (m - 1.0) / (m + 1.0);
    let q = t * t;
    let series = 2.0 * t * (1.0 + q * (1.0 / 3.0 + q * (0.2 + q * (1.0 / 7.0 + q * (1.0 / 9.0)))));
    series + exponent * std::f32::consts::LN_2
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn logarithm_agrees_with_the_library() {
        for k in 0..20_000 {
            let x = (k as f32 * 0.001).exp();
            assert!((ln(x) - x.ln()).abs() <= 2e-6 * x.ln().max(0.1), "{x}");
        }
    }

    #[test]
    fn squares_are_added_over_rows_of_any_length() {
        let row: Vec<f32> = (0..37).map(|k| k as f32).collect();
        let mut sums = vec![1.0; 37];
        assert_eq!(add_squares(&row, &mut sums), 16206.0);
        assert!(sums.iter().zip(&row).all(|(s, v)| *s == 1.0 + v * v));
    }

    #[test]
    fn positions_outside_the_image_are_clamped() {
        let image = [1.0; 25];
        let mut out = [0.0; 5];
        bilinear_line(&image, 5, [f64::NAN, -1e30], [1e30, f64::NAN], &mut out);
        bilinear_table(
            &image,
            5,
            &[Bilinear {
                at: u32::MAX,
                along: 0.5,
                across: 0.5,
            }; 5],
            &mut out,
        );
        assert_eq!(out, [1.0; 5]);
    }
}
