use gyre_radar::fourier::Complex32;
use ndarray::ArrayView2;

use crate::{ShapeError, expect_shape, kernels};

/// The polar magnitude spectrum of one scan, transformed along the angle: all that a rotation
/// search needs of the scan.
///
/// Radius x harmonic. Harmonic 0, the mean over the angle, is zero.
#[derive(Debug, Clone, PartialEq)]
pub struct PolarSpectrum {
    angles: usize,
    pub(crate) data: Vec<Complex32>,
    /// Sum of squares over all angles and radii, times the number of angles; 0 if that is not
    /// finite.
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

    pub(crate) fn expect(&self, radii: usize, angles: usize) -> Result<(), ShapeError> {
        let actual = [self.radii(), self.angles];
        expect_shape("polar spectrum (radii x angles)", actual, [radii, angles])
    }

    pub fn radii(&self) -> usize {
        self.data.len() / self.harmonics()
    }

    pub fn harmonics(&self) -> usize {
        self.angles / 2 + 1
    }

    pub fn view(&self) -> ArrayView2<'_, Complex32> {
        ArrayView2::from_shape((self.radii(), self.harmonics()), &self.data)
            .expect("the data are planned as radii x harmonics")
    }

    /// Energy over all angles and radii: each harmonic stands for its mirror image too, but for the
    /// highest of an even number of angles.
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
