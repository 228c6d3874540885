//! Phase-only spectra: Checchin et al., Eq. 6, in the form I2 I1* / |I2 I1*|.

use std::sync::Arc;

use gyre_radar::fourier::{Complex32, Fft, FftDirection};

/// Sets the modulus to one and keeps the phase; zero stays zero.
pub(crate) fn to_unit(z: &mut Complex32) {
    let modulus = z.norm();
    *z = if modulus > 0.0 && modulus.is_finite() {
        *z / modulus
    } else {
        Complex32::default()
    };
}

/// Whitens spectra along the radius that are already transformed along the angle.
///
/// The sum of the product over radial frequencies is then the phase correlation at radial shift 0.
pub(crate) struct Whitening {
    harmonics: usize,
    fft: Arc<dyn Fft<f32>>,
    column: Vec<Complex32>,
    scratch: Vec<Complex32>,
}

impl Whitening {
    pub fn new(radii: usize, harmonics: usize) -> Self {
        let fft = gyre_radar::fourier::complex(radii, FftDirection::Forward);
        let scratch = vec![Complex32::default(); fft.get_inplace_scratch_len()];
        Self {
            harmonics,
            fft,
            column: vec![Complex32::default(); radii],
            scratch,
        }
    }

    /// Replaces the spectrum (radius after radius) by the phase of its transform along the radius.
    pub fn apply(&mut self, data: &mut [Complex32]) {
        for h in 1..self.harmonics {
            let radius = data[h..].iter().step_by(self.harmonics);
            self.column
                .iter_mut()
                .zip(radius)
                .for_each(|(c, z)| *c = *z);
            self.fft
                .process_with_scratch(&mut self.column, &mut self.scratch);
            self.column.iter_mut().for_each(to_unit);
            let radius = data[h..].iter_mut().step_by(self.harmonics);
            radius.zip(&self.column).for_each(|(z, c)| *z = *c);
        }
    }
}
