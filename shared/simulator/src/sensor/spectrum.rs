//! What the receiver makes of echoes: a spectrum over range, and its power in logarithmic steps.

use crate::profile::Receiver;

/// Resolution cells to each side of an echo up to which its point response is kept: side lobes are 55 dB down there.
const CELLS_KEPT: f64 = 4.0;
/// Positions below a bin for which the response is tabulated.
const SUB_BINS: usize = 16;
/// Energy of the point response in cells: what independent noise of power 1 in each cell adds up to in every bin.
pub const NOISE_OVERLAP: f32 = 1.5;

/// Amplitude spectrum of one azimuth over range, to which echoes are added.
#[derive(Clone, Debug)]
pub struct RangeSpectrum {
    /// For each of [`SUB_BINS`] positions the response at `taps` bins.
    response: Vec<f32>,
    taps: usize,
    real: Vec<f32>,
    imaginary: Vec<f32>,
    /// Power of what does not interfere.
    incoherent: Vec<f32>,
    bins: usize,
    bins_per_cell: f64,
    full_scale: f32,
    whole_powers: bool,
}

impl RangeSpectrum {
    /// An empty spectrum of so many range bins of `bin_m` metres.
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

    /// Removes all echoes.
    pub fn clear(&mut self) {
        self.real.fill(0.0);
        self.imaginary.fill(0.0);
        self.incoherent.fill(0.0);
    }

    /// Independent cells of noise in the spectrum, and the distance between them in bins.
    pub fn noise_cells(&self) -> (usize, f64) {
        (
            (self.bins as f64 / self.bins_per_cell) as usize + 1,
            self.bins_per_cell,
        )
    }

    /// Adds an echo at `bin` (fractions count) with a complex amplitude; its peak power is the amplitude's square.
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

    /// Adds an echo that does not interfere, of so much power.
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

    /// Which response an echo has, and the first place that it fills; `None` out of range.
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

    /// Places before and behind the spectrum, so that responses need no limits.
    fn pad(&self) -> usize {
        self.taps + 1
    }

    /// Writes the spectrum's power as the sensor would: one byte a bin, half a decibel a count.
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

/// Spectrum of a Hann window, 1 at its peak, `cells` resolution cells away.
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

/// Power to counts of half a decibel; what is stronger than `full_scale` is compressed.
///
/// The CTS350-X and the RAS6 send whole numbers of power: scans hold 0, 6, 9, 12, 14, 15, 17, ... (powers 1, 2, 3, ...) and
/// nothing between.
pub fn counts(power: f32, full_scale: f32, whole_powers: bool) -> u8 {
    let compressed = power / (1.0 + power / full_scale);
    let power = if whole_powers {
        (compressed + NO_FRACTIONS) - NO_FRACTIONS
    } else {
        compressed
    };
    (6.020_6 * log2(power.max(1.0)) - 0.1 + NO_FRACTIONS).to_bits() as u8
}

/// A sum with this has no bits left for a fraction, so it is rounded, and its last byte is the whole number: without calls or casts that
/// look at each number alone, the loop over bins runs several at once.
const NO_FRACTIONS: f32 = 8_388_608.0;

/// Logarithm of a number of at least 1, to 1e-4: by arithmetic alone, so that all machines agree on it.
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
    fn logarithm_is_right_to_a_ten_thousandth() {
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
    fn an_echo_looks_the_same_whether_it_could_interfere_or_not() {
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
