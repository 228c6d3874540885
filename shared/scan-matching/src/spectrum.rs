//! What a rotation search keeps of one scan.

use rustfft::num_complex::Complex32;

use crate::{ShapeError, expect_shape, kernels};

/// The polar magnitude spectrum of one scan, transformed along the angle: all that a rotation search needs of it.
///
/// Row after row of `harmonics()` values, one row a radius (a single one for `line14`). Harmonic 0, the mean over
/// the angle, is zero.
#[derive(Debug, Clone, PartialEq)]
pub struct PolarSpectrum {
    angles: usize,
    pub(crate) data: Vec<Complex32>,
    /// Sum of squares over all angles and radii, times the number of angles; 0 where it is no number.
    pub(crate) energy: f64,
}

impl PolarSpectrum {
    pub(crate) fn new(angles: usize, radii: usize) -> Self {
        Self {
            angles,
            data: vec![Complex32::default(); radii * (angles / 2 + 1)],
            energy: 0.0,
        }
    }

    /// Refuses a spectrum of another shape.
    pub(crate) fn expect(&self, angles: usize, radii: usize) -> Result<(), ShapeError> {
        expect_shape("polar spectrum's angle", self.angles, angles)?;
        expect_shape("polar spectrum", self.data.len(), radii * self.harmonics())
    }

    /// Number of harmonics a radius: `angles / 2 + 1`.
    pub fn harmonics(&self) -> usize {
        self.angles / 2 + 1
    }

    /// Number of radii.
    pub fn radii(&self) -> usize {
        self.data.len() / self.harmonics()
    }

    /// The spectrum, radius after radius.
    pub fn as_slice(&self) -> &[Complex32] {
        &self.data
    }

    /// Takes over a spectrum that [`as_slice`](Self::as_slice) gave elsewhere.
    ///
    /// # Errors
    /// Where the length differs.
    pub fn copy_from_slice(&mut self, data: &[Complex32]) -> Result<(), ShapeError> {
        expect_shape("polar spectrum", data.len(), self.data.len())?;
        self.data.copy_from_slice(data);
        self.measure();
        Ok(())
    }

    /// Energy over all angles and radii: each harmonic stands for its mirror image too, but for the highest of an even
    /// number of angles.
    pub(crate) fn measure(&mut self) {
        let harmonics = self.harmonics();
        let alone = |row: &[Complex32]| {
            if self.angles.is_multiple_of(2) {
                kernels::energy(&row[harmonics - 1..])
            } else {
                0.0
            }
        };
        let rows = self.data.chunks_exact(harmonics);
        let energy: f64 = rows
            .map(|row| f64::from(2.0 * kernels::energy(row) - alone(row)))
            .sum();
        self.energy = if energy.is_finite() { energy } else { 0.0 };
    }
}
