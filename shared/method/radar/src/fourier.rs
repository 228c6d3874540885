//! Fourier transforms of `f32` by `rustfft` and `realfft`, compiled here once.
//!
//! Both are generic in the number. Each crate that plans a transform itself compiles all algorithms
//! of these again, which takes longer than the rest of the crate.

use std::sync::Arc;

pub use realfft::{ComplexToReal, RealToComplex};
use realfft::{RealFftPlanner, num_complex};
use rustfft::FftPlanner;
pub use rustfft::{Fft, FftDirection};

pub use num_complex::Complex32;

/// Plans a transform of `size` complex values. Neither direction is scaled.
pub fn complex(size: usize, direction: FftDirection) -> Arc<dyn Fft<f32>> {
    FftPlanner::new().plan_fft(size, direction)
}

/// Plans a transform of `size` real values into size / 2 + 1 complex ones, not scaled.
pub fn real(size: usize) -> Arc<dyn RealToComplex<f32>> {
    RealFftPlanner::new().plan_fft_forward(size)
}

/// Plans a transform of size / 2 + 1 complex values into `size` real ones, not scaled.
pub fn real_inverse(size: usize) -> Arc<dyn ComplexToReal<f32>> {
    RealFftPlanner::new().plan_fft_inverse(size)
}
