//! Magnitude spectra on a polar grid.
//!
//! From f(x) ~ g(R x + t) follows |F(k)| = |G(R k)|: a rotation of the raster rotates its magnitude
//! spectrum, and a shift does not change it. With k = rho (cos theta, sin theta) along the raster's
//! x and y axes, P_f(theta) = P_g(theta + turn).

use std::f64::consts::{FRAC_PI_2, PI};

use crate::{
    config::{Magnitude, RotationConfig},
    fft::Columns,
    kernels::{self, Bilinear},
};

/// The magnitudes of the band, and the polar grid over them.
pub(crate) struct PolarGrid {
    kind: Magnitude,
    /// Frequency bins kept on each side of zero.
    bins: usize,
    /// Column c holds column frequency c; its element k row frequency k - bins.
    magnitude: Vec<f32>,
    /// The position of each polar sample among the magnitudes, radius after radius.
    table: Vec<Bilinear>,
    pub angles: usize,
    pub radii: usize,
}

impl PolarGrid {
    /// The grid over a spectrum of `size` a side, of a raster of `n` a side.
    ///
    /// theta_k = -pi/2 + k pi / angles: no angle is counted twice (the Linspace of Weston et al.
    /// counts both ends).
    pub fn new(n: usize, size: usize, config: &RotationConfig) -> Self {
        let (low, high) = (config.band_low, config.band_high);
        let radii = config
            .radii
            .unwrap_or(((high - low) * n as f64).ceil() as usize)
            .max(2);
        let bins = (high * size as f64).floor() as usize + 1;
        let sample = |r: usize, k: usize| {
            let rho = (low + (high - low) * r as f64 / (radii - 1) as f64) * size as f64;
            let theta = -FRAC_PI_2 + k as f64 * PI / config.angles as f64;
            sample_at(rho * theta.cos(), rho * theta.sin(), bins)
        };
        Self {
            kind: config.magnitude,
            bins,
            magnitude: vec![0.0; (bins + 1) * (2 * bins + 1)],
            table: (0..radii)
                .flat_map(|r| (0..config.angles).map(move |k| sample(r, k)))
                .collect(),
            angles: config.angles,
            radii,
        }
    }

    /// Number of columns of the spectrum that the grid reads.
    pub fn columns(bins_high: f64, size: usize) -> usize {
        ((bins_high * size as f64).floor() as usize + 2).min(size / 2 + 1)
    }

    pub fn load(&mut self, spectrum: &Columns) {
        let stride = 2 * self.bins + 1;
        for (c, out) in self.magnitude.chunks_exact_mut(stride).enumerate() {
            let column = spectrum.column(c);
            kernels::modulus(&column[column.len() - self.bins..], &mut out[..self.bins]);
            kernels::modulus(&column[..=self.bins], &mut out[self.bins..]);
        }
        if self.kind == Magnitude::Log {
            compress(&mut self.magnitude);
        }
    }

    pub fn ring(&self, r: usize, out: &mut [f32]) {
        let stride = 2 * self.bins + 1;
        kernels::bilinear_table(
            &self.magnitude,
            stride,
            &self.table[r * self.angles..][..self.angles],
            out,
        );
    }
}

/// The sample at row frequency `u` and column frequency `v`, in bins; a real image has the same at
/// (-u, -v).
fn sample_at(u: f64, v: f64, bins: usize) -> Bilinear {
    let (u, v) = if v < 0.0 { (-u, -v) } else { (u, v) };
    let row = (u + bins as f64).clamp(0.0, 2.0 * bins as f64);
    let (i, j) = (
        (row.floor() as usize).min(2 * bins - 1),
        (v.floor() as usize).min(bins - 1),
    );
    Bilinear {
        at: (j * (2 * bins + 1) + i) as u32,
        along: (row - i as f64) as f32,
        across: (v - j as f64) as f32,
    }
}

/// ln(1 + m / mean): the same for every gain of the radar.
fn compress(magnitude: &mut [f32]) {
    let mean = magnitude.iter().sum::<f32>() / magnitude.len() as f32;
    let scale = if mean > 0.0 { mean.recip() } else { 0.0 };
    kernels::log1p_scaled(magnitude, scale);
}
