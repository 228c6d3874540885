//! Range processing: the spectrum of one azimuth, and its power in logarithmic steps.

use crate::profile::Receiver;

/// Half-length of the point response, resolution cells: side lobes beyond are 55 dB down.
const CELLS_KEPT: f64 = 4.0;
const SUB_BINS: usize = 16;
/// Energy of the point response in cells: mean power in every bin of independent noise with power 1
/// in each cell.
pub const NOISE_OVERLAP: f32 = 1.5;

/// The complex amplitudes of one azimuth over range.
#[derive(Clone, Debug)]
pub struct RangeSpectrum {
    /// The response at `taps` bins for each of [`SUB_BINS`] positions.
    response: Vec<f32>,
    taps: usize,
    real: Vec<f32>,
    imaginary: Vec<f32>,
    incoherent: Vec<f32>,
    bins: usize,
    bins_per_cell: f64,
    full_scale: f32,
    whole_powers: bool,
}

impl RangeSpectrum {
    pub fn new(bins: usize, bin_m: f64, receiver: &Receiver) -> Self {
        let bins_per_cell = receiver.cell_m / bin_m;
        let half = (bins_per_cell * CELLS_KEPT).ceil() as usize;
        let taps = 2 * half + 1;
        let at = |sub: usize, tap: usize| tap as f64 - half as f64 - sub as f64 / SUB_BINS as f64;
        let response = (0..SUB_BINS * taps)
            .map(|index| hann_response(at(index / taps, index % taps) / bins_per_cell) as f32)
            .collect();
        let empty = vec![0.0; bins + 2 * (taps + 1)];
        Self {
            response,
            taps,
            real: empty.clone(),
            imaginary: empty.clone(),
            incoherent: empty,
            bins,
            bins_per_cell,
            full_scale: receiver.full_scale,
            whole_powers: receiver.whole_powers,
        }
    }

    pub fn clear(&mut self) {
        self.real.fill(0.0);
        self.imaginary.fill(0.0);
        self.incoherent.fill(0.0);
    }

    /// Number of independent noise cells in the spectrum, and their distance in bins.
    pub fn noise_cells(&self) -> (usize, f64) {
        (
            (self.bins as f64 / self.bins_per_cell) as usize + 1,
            self.bins_per_cell,
        )
    }

    /// Adds an echo at `bin` (with fractions) with a complex amplitude; its peak power is the
    /// amplitude's square.
    pub fn add(&mut self, bin: f64, real: f32, imaginary: f32) {
        let Some((response, first)) = self.place(bin) else {
            return;
        };
        let response = &self.response[response * self.taps..(response + 1) * self.taps];
        let span = first..first + self.taps;
        for (value, tap) in self.real[span.clone()].iter_mut().zip(response) {
            *value += real * tap;
        }
        for (value, tap) in self.imaginary[span].iter_mut().zip(response) {
            *value += imaginary * tap;
        }
    }

    pub fn add_power(&mut self, bin: f64, power: f32) {
        let Some((response, first)) = self.place(bin) else {
            return;
        };
        let response = &self.response[response * self.taps..(response + 1) * self.taps];
        for (value, tap) in self.incoherent[first..first + self.taps]
            .iter_mut()
            .zip(response)
        {
            *value += power * tap * tap;
        }
    }

    /// The response of an echo, and the first bin that it fills; `None` out of range.
    fn place(&self, bin: f64) -> Option<(usize, usize)> {
        if !(0.0..self.bins as f64).contains(&bin) {
            return None;
        }
        let steps = (bin * SUB_BINS as f64 + 0.5) as usize;
        Some((
            steps % SUB_BINS,
            steps / SUB_BINS + self.pad() - self.taps / 2,
        ))
    }

    /// Padding at both ends, so that responses need no clipping.
    fn pad(&self) -> usize {
        self.taps + 1
    }

    /// Writes the power as the sensor does: one byte a bin, half a decibel a count.
    pub fn read_out(&self, row: &mut [u8]) {
        let span = self.pad()..self.pad() + self.bins;
        let parts = self.real[span.clone()]
            .iter()
            .zip(&self.imaginary[span.clone()])
            .zip(&self.incoherent[span]);
        let powers = parts.map(|((re, im), power)| re * re + im * im + power);
        for (byte, power) in row.iter_mut().zip(powers) {
            *byte = counts(power, self.full_scale, self.whole_powers);
        }
    }
}

/// Spectrum of a Hann window, 1 at its peak, `cells` resolution cells from it.
fn hann_response(cells: f64) -> f64 {
    let sinc = |u: f64| {
        if u.abs() < 1e-9 {
            1.0
        } else {
            (std::f64::consts::PI * u).sin() / (std::f64::consts::PI * u)
        }
    };
    sinc(cells) + 0.5 * (sinc(cells - 1.0) + sinc(cells + 1.0))
}

/// Converts power to counts of half a decibel, with compression above `full_scale`.
/// The CTS350-X and the RAS6 send integer powers: scans hold 0, 6, 9, 12, 14, 15, 17, ... (powers
/// 1, 2, 3, ...) and nothing between.
pub fn counts(power: f32, full_scale: f32, whole_powers: bool) -> u8 {
    let compressed = power / (1.0 + power / full_scale);
    let power = if whole_powers {
        (compressed + NO_FRACTIONS) - NO_FRACTIONS
    } else {
        compressed
    };
    (6.020_6 * log2(power.max(1.0)) - 0.1 + NO_FRACTIONS).to_bits() as u8
}

/// The sum with this constant is rounded to an integer, which is in its last byte. This vectorises,
/// unlike casts and calls.
const NO_FRACTIONS: f32 = 8_388_608.0;

/// Logarithm of a number of at least 1, accurate to 1e-4; arithmetic alone, so that all machines
/// agree.
fn log2(value: f32) -> f32 {
    let bits = value.to_bits();
    let exponent = (bits >> 23) as i32 - 127;
    let mantissa = f32::from_bits((bits & 0x007f_ffff) | 0x3f80_0000);
    // log2(m) = 2/ln(2) * artanh(t), t = (m - 1) / (m + 1) <= 1/3.
    let t = (mantissa - 1.0) / (mantissa + 1.0);
    let t2 = t * t;
    exponent as f32
        + 2.885_39 * t * (1.0 + t2 * (0.333_333 + t2 * (0.2 + t2 * (0.142_857 + t2 * 0.111_111))))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::profile::Profile;

    fn spectrum(bins: usize) -> RangeSpectrum {
        let (sampling, receiver) = (
            Profile::Cts350xOxford.sampling(),
            Profile::Cts350xOxford.receiver(),
        );
        RangeSpectrum::new(bins, sampling.range_resolution_m, &receiver)
    }

    #[test]
    fn logarithm_is_accurate_to_a_ten_thousandth() {
        for step in 0..2000 {
            let value = 1.01f32.powi(step);
            assert!((log2(value) - value.log2()).abs() < 2e-4, "{value}");
        }
    }

    #[test]
    fn counts_have_the_gaps_of_real_scans_and_never_wrap() {
        let steps: Vec<u8> = (0..10)
            .map(|power| counts(power as f32, 1e7, true))
            .collect();
        assert_eq!(steps, [0, 0, 6, 9, 12, 14, 15, 17, 18, 19]);
        assert_eq!(counts(1.0e5, 1e7, true), 100);
        assert!((134..=140).contains(&counts(1e7, 1e7, true)));
        assert!(counts(f32::MAX, 1e7, true) == 0 || counts(f32::MAX, 1e7, true) >= 139);
        assert_eq!(counts(1.2, 1e7, false), 1);
    }

    #[test]
    fn echo_peaks_at_its_bin_and_falls_by_3_db_within_4_bins() {
        let mut spectrum = spectrum(400);
        spectrum.add(200.0, 300.0, 400.0);
        let mut row = vec![0; 400];
        spectrum.read_out(&mut row);
        assert_eq!(row[200], counts(250_000.0, 1e7, true));
        assert!(
            row[196] < row[200] - 4 && row[196] > row[200] - 9,
            "{:?}",
            &row[190..211]
        );
        assert_eq!(row[196], row[204]);
        assert!(row[150] == 0 && row[250] == 0);
    }

    #[test]
    fn a_single_echo_is_the_same_whether_coherent_or_not() {
        let (mut wave, mut power) = (spectrum(400), spectrum(400));
        wave.add(123.4, 30.0, 40.0);
        power.add_power(123.4, 2500.0);
        let (mut first, mut second) = (vec![0; 400], vec![0; 400]);
        wave.read_out(&mut first);
        power.read_out(&mut second);
        assert!(first.iter().zip(&second).all(|(a, b)| a.abs_diff(*b) <= 1));
    }

    #[test]
    fn noise_cells_give_the_stated_mean_power_in_every_bin() {
        let mut spectrum = spectrum(1200);
        let (cells, spacing) = spectrum.noise_cells();
        let mut power = vec![0.0f32; 1200];
        for cell in 0..cells {
            spectrum.clear();
            spectrum.add(cell as f64 * spacing, 1.0, 0.0);
            for (bin, sum) in power.iter_mut().enumerate() {
                *sum += spectrum.real[bin + spectrum.pad()].powi(2);
            }
        }
        for (bin, sum) in power.iter().enumerate().skip(50).take(1100) {
            assert!((sum - NOISE_OVERLAP).abs() < 0.02, "bin {bin}: {sum}");
        }
    }

    #[test]
    fn echoes_at_both_ends_stay_inside() {
        let mut spectrum = spectrum(100);
        for bin in [-3.0, 0.0, 0.01, 99.0, 99.99, 100.0, f64::NAN] {
            spectrum.add(bin, 10.0, 0.0);
        }
        let mut row = vec![0; 100];
        spectrum.read_out(&mut row);
        assert!(row[0] > 0 && row[99] > 0);
    }
}
