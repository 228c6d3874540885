//! The inner loops, compiled for several vector units; the one that the processor has is picked at run time.

use multiversion::multiversion;
use rustfft::num_complex::Complex32;

/// Bilinear values along a straight line through an n-wide image.
///
/// `start` and `step` are (row, column) in cells. The caller keeps the line within the image; a sample that rounding
/// puts outside is moved to the edge.
#[multiversion(targets("x86_64+avx512f+avx512vl+avx512bw+avx512dq", "x86_64+avx2+fma", "aarch64+neon"))]
pub(crate) fn bilinear_line(image: &[f32], n: usize, start: [f64; 2], step: [f64; 2], out: &mut [f32]) {
    let last = (n - 2) as i32;
    let [row, col] = start.map(|s| s as f32);
    let [row_step, col_step] = step.map(|s| s as f32);
    for (k, value) in out.iter_mut().enumerate() {
        let (u, v) = (row + k as f32 * row_step, col + k as f32 * col_step);
        let (i, j) = ((u as i32).clamp(0, last), (v as i32).clamp(0, last));
        let (a, b) = (u - i as f32, v - j as f32);
        let at = i as usize * n + j as usize;
        let (Some(upper), Some(lower)) = (image.get(at..at + 2), image.get(at + n..at + n + 2)) else { continue };
        let top = upper[0] + b * (upper[1] - upper[0]);
        let bottom = lower[0] + b * (lower[1] - lower[0]);
        *value = top + a * (bottom - top);
    }
}

/// Adds the square of each value to `sums`; returns the sum of the squares.
#[multiversion(targets("x86_64+avx512f+avx512vl+avx512bw+avx512dq", "x86_64+avx2+fma", "aarch64+neon"))]
pub(crate) fn add_squares(row: &[f32], sums: &mut [f32]) -> f32 {
    let mut total = 0.0;
    for (sum, &v) in sums.iter_mut().zip(row) {
        *sum += v * v;
        total += v * v;
    }
    total
}

/// |z| of each value.
#[multiversion(targets("x86_64+avx512f+avx512vl+avx512bw+avx512dq", "x86_64+avx2+fma", "aarch64+neon"))]
pub(crate) fn modulus(spectrum: &[Complex32], out: &mut [f32]) {
    for (m, z) in out.iter_mut().zip(spectrum) {
        *m = (z.re * z.re + z.im * z.im).sqrt();
    }
}

/// ln(1 + scale m) of each value, all at least 0, to 2e-6 relative.
#[multiversion(targets("x86_64+avx512f+avx512vl+avx512bw+avx512dq", "x86_64+avx2+fma", "aarch64+neon"))]
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
}
