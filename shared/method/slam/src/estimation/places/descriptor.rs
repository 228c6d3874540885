use gyre_matching::{Magnitude, PolarSpectrum, RotationConfig, RotationSearch, Submap, Taper};
use gyre_radar::fourier::Complex32;
use ndarray::Array2;

use super::{CELL_M, PLANNED, RASTER_CELLS};

pub(super) const RADII: usize = 40;
/// Harmonics over half a turn that a descriptor keeps, from the first on.
pub(super) const HARMONICS: usize = 64;
/// Harmonics whose amplitudes make the sieve, from the first on.
pub(super) const SIEVE_HARMONICS: usize = 16;
pub(super) const SPECTRUM_BYTES: usize = RADII * 2 * HARMONICS;
/// Radii of the spectrum that are added up for each of the descriptor's: the samples of a coarser
/// grid would miss half of the spectrum.
const FOLD: usize = 2;
/// Largest amplitude in the sieve, as a share of its radius.
const SIEVE_FULL: f32 = 0.64;

/// The appearance of a submap, whatever its heading: its polar magnitude spectrum over the angle,
/// in harmonics.
#[derive(Debug, Clone, PartialEq)]
pub struct Descriptor {
    /// Radius after radius the real parts of all harmonics, then the imaginary parts.
    pub(super) spectrum: Vec<i8>,
    pub(super) sieve: Vec<u8>,
}

/// Computes descriptors. Planned once.
pub struct Describer {
    search: RotationSearch,
    raster: Array2<f32>,
    spectrum: PolarSpectrum,
    /// The descriptor before it is rounded.
    exact: Vec<f32>,
}

impl Default for Descriptor {
    fn default() -> Self {
        Self {
            spectrum: vec![0; SPECTRUM_BYTES],
            sieve: vec![0; Self::SIEVE_BYTES],
        }
    }
}

impl Descriptor {
    pub const SIEVE_BYTES: usize = RADII * SIEVE_HARMONICS;
    pub const BYTES: usize = Self::SIEVE_BYTES + SPECTRUM_BYTES;

    /// Appends the form in a file: the sieve, then the spectrum.
    pub fn encode(&self, bytes: &mut Vec<u8>) {
        bytes.extend_from_slice(&self.sieve);
        bytes.extend_from_slice(bytemuck::cast_slice(&self.spectrum));
    }

    /// Decodes what [`encode`](Self::encode) has written; `None` if `bytes` are not
    /// [`BYTES`](Self::BYTES).
    pub fn decode(bytes: &[u8]) -> Option<Self> {
        let (sieve, spectrum) = bytes.split_at_checked(Self::SIEVE_BYTES)?;
        (spectrum.len() == SPECTRUM_BYTES).then(|| Self {
            sieve: sieve.to_vec(),
            spectrum: bytemuck::cast_slice(spectrum).to_vec(),
        })
    }
}

impl Default for Describer {
    fn default() -> Self {
        Self::new()
    }
}

impl Describer {
    pub fn new() -> Self {
        let config = RotationConfig {
            // Lengths along the angle are padded fourfold, so that the spectrum's structure is
            // sampled often enough.
            angles: 4 * HARMONICS,
            radii: Some(FOLD * RADII),
            band_low: 0.02,
            band_high: 0.42,
            magnitude: Magnitude::Log,
            window: Taper::RadialHann,
            ..RotationConfig::default()
        };
        let search = RotationSearch::new(RASTER_CELLS, &config).expect("a valid configuration");
        Self {
            spectrum: search.new_spectrum(),
            search,
            raster: Array2::zeros((RASTER_CELLS, RASTER_CELLS)),
            exact: vec![0.0; SPECTRUM_BYTES],
        }
    }

    /// Computes the descriptor of a submap. The descriptor of an empty submap is zero, and similar
    /// to no other.
    pub fn describe(&mut self, submap: &Submap, out: &mut Descriptor) {
        submap.draw(CELL_M, &mut self.raster);
        let raster = self.raster.view();
        self.search
            .spectrum(raster, &mut self.spectrum)
            .expect(PLANNED);
        self.whiten();
        for (radius, sieve) in self
            .exact
            .chunks_exact(2 * HARMONICS)
            .zip(out.sieve.chunks_exact_mut(SIEVE_HARMONICS))
        {
            let (re, im) = radius.split_at(HARMONICS);
            for ((sieve, re), im) in sieve.iter_mut().zip(re).zip(im) {
                *sieve = (re.hypot(*im) / SIEVE_FULL * 255.0) as u8;
            }
        }
        let largest = self.exact.iter().fold(0.0_f32, |max, v| max.max(v.abs()));
        let scale = if largest > 0.0 { 127.0 / largest } else { 0.0 };
        for (rounded, exact) in out.spectrum.iter_mut().zip(&self.exact) {
            *rounded = (scale * exact).round() as i8;
        }
    }

    /// Adds up neighbouring radii, and scales each to the same energy.
    fn whiten(&mut self) {
        let spectrum = self.spectrum.view();
        for (r, out) in self.exact.chunks_exact_mut(2 * HARMONICS).enumerate() {
            for h in 0..HARMONICS {
                // Harmonic 0 is the mean.
                let sum: Complex32 = (0..FOLD).map(|k| spectrum[[FOLD * r + k, h + 1]]).sum();
                (out[h], out[HARMONICS + h]) = (sum.re, sum.im);
            }
            let norm = out.iter().map(|v| v * v).sum::<f32>().sqrt();
            let scale = if norm > 0.0 { norm.recip() } else { 0.0 };
            out.iter_mut().for_each(|v| *v *= scale);
        }
    }
}
