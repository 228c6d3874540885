//! What the receiver makes of echoes: a spectrum over range, and its power in logarithmic steps.

/// Range bins that one resolution cell spans: the spectrum is zero-padded about so much (3 dB width 8 bins, 0.35 m).
const BINS_PER_CELL: f64 = 5.5;
/// Resolution cells to each side of an echo up to which its point response is kept: side lobes are 55 dB down there.
const CELLS_KEPT: f64 = 4.0;
/// Bins to each side that the response fills.
const HALF_TAPS: usize = (BINS_PER_CELL * CELLS_KEPT) as usize;
const TAPS: usize = 2 * HALF_TAPS + 1;
/// Positions below a bin for which the response is tabulated.
const SUB_BINS: usize = 16;
/// Bins before and behind the spectrum, so that responses need no limits.
const PAD: usize = TAPS + 1;
/// The receiver's full scale, in units of its power: stronger echoes are compressed.
const FULL_SCALE: f32 = 1.0e7;

/// Amplitude spectrum of one azimuth over range, to which echoes are added.
#[derive(Clone, Debug)]
pub struct RangeSpectrum {
    response: Vec<[f32; TAPS]>,
    real: Vec<f32>,
    imaginary: Vec<f32>,
    bins: usize,
}

impl RangeSpectrum {
    /// An empty spectrum of so many range bins.
    pub fn new(bins: usize) -> Self {
        let response = (0..SUB_BINS).map(response_at).collect();
        Self { response, real: vec![0.0; bins + 2 * PAD], imaginary: vec![0.0; bins + 2 * PAD], bins }
    }

    /// Removes all echoes.
    pub fn clear(&mut self) {
        self.real.fill(0.0);
        self.imaginary.fill(0.0);
    }

    /// Independent cells of noise in the spectrum, and the distance between them in bins.
    pub fn noise_cells(&self) -> (usize, f64) {
        ((self.bins as f64 / BINS_PER_CELL) as usize + 1, BINS_PER_CELL)
    }

    /// Adds an echo at `bin` (fractions count) with a complex amplitude; its peak power is the amplitude's square.
    pub fn add(&mut self, bin: f64, real: f32, imaginary: f32) {
        if !(0.0..self.bins as f64).contains(&bin) {
            return;
        }
        let steps = (bin * SUB_BINS as f64).round() as usize;
        let response = &self.response[steps % SUB_BINS];
        let first = steps / SUB_BINS + PAD - HALF_TAPS;
        let span = first..first + TAPS;
        for (value, tap) in self.real[span.clone()].iter_mut().zip(response) {
            *value += real * tap;
        }
        for (value, tap) in self.imaginary[span].iter_mut().zip(response) {
            *value += imaginary * tap;
        }
    }

    /// Writes the spectrum's power as the sensor would: one byte a bin, half a decibel a count.
    pub fn read_out(&self, row: &mut [u8]) {
        let real = &self.real[PAD..PAD + self.bins];
        let imaginary = &self.imaginary[PAD..PAD + self.bins];
        for ((byte, re), im) in row.iter_mut().zip(real).zip(imaginary) {
            *byte = counts(re * re + im * im);
        }
    }
}

/// Variance of a noise cell's amplitude for a mean power of 1 in every bin: neighbouring cells' responses overlap by this much.
pub const NOISE_OVERLAP: f32 = 1.5;

/// The Hann window's response at each tap, for an echo `sub_bin / SUB_BINS` bins above the middle tap.
fn response_at(sub_bin: usize) -> [f32; TAPS] {
    let shift = sub_bin as f64 / SUB_BINS as f64;
    std::array::from_fn(|tap| hann_response((tap as f64 - HALF_TAPS as f64 - shift) / BINS_PER_CELL) as f32)
}

/// Spectrum of a Hann window, 1 at its peak, `cells` resolution cells away.
fn hann_response(cells: f64) -> f64 {
    let sinc =
        |u: f64| if u.abs() < 1e-9 { 1.0 } else { (std::f64::consts::PI * u).sin() / (std::f64::consts::PI * u) };
    sinc(cells) + 0.5 * (sinc(cells - 1.0) + sinc(cells + 1.0))
}

/// Power to counts. The sensor's bytes are whole numbers of power in steps of half a decibel: real scans hold
/// 0, 6, 9, 12, 14, 15, 17, ... (powers 1, 2, 3, ...) and nothing between.
pub fn counts(power: f32) -> u8 {
    let compressed = power / (1.0 + power / FULL_SCALE);
    let whole = compressed.round().max(1.0);
    (20.0 * whole.log10() + 0.4) as u8
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn counts_have_the_gaps_of_real_scans_and_never_wrap() {
        let steps: Vec<u8> = (0..10).map(|power| counts(power as f32)).collect();
        assert_eq!(steps, [0, 0, 6, 9, 12, 14, 15, 17, 18, 19]);
        assert_eq!(counts(1.0e5), 100);
        assert!(counts(f32::MAX) == 0 || counts(f32::MAX) >= 139);
        assert!((134..=140).contains(&counts(FULL_SCALE)));
    }

    #[test]
    fn echo_peaks_at_its_bin_and_falls_by_3_db_within_4_bins() {
        let mut spectrum = RangeSpectrum::new(400);
        spectrum.add(200.0, 300.0, 400.0);
        let mut row = vec![0; 400];
        spectrum.read_out(&mut row);
        assert_eq!(row[200], counts(250_000.0));
        assert!(row[196] < row[200] - 4 && row[196] > row[200] - 9, "{:?}", &row[190..211]);
        assert_eq!(row[196], row[204]);
        assert!(row[150] == 0 && row[250] == 0);
    }

    #[test]
    fn noise_cells_give_the_stated_mean_power_in_every_bin() {
        let mut spectrum = RangeSpectrum::new(1200);
        let (cells, spacing) = spectrum.noise_cells();
        let mut power = vec![0.0f32; 1200];
        for cell in 0..cells {
            spectrum.clear();
            spectrum.add(cell as f64 * spacing, 1.0, 0.0);
            for (bin, sum) in power.iter_mut().enumerate() {
                *sum += spectrum.real[bin + PAD].powi(2);
            }
        }
        for (bin, sum) in power.iter().enumerate().skip(50).take(1100) {
            assert!((sum - NOISE_OVERLAP).abs() < 0.01, "bin {bin}: {sum}");
        }
    }

    #[test]
    fn echoes_at_both_ends_stay_inside() {
        let mut spectrum = RangeSpectrum::new(100);
        for bin in [-3.0, 0.0, 0.01, 99.0, 99.99, 100.0, f64::NAN] {
            spectrum.add(bin, 10.0, 0.0);
        }
        let mut row = vec![0; 100];
        spectrum.read_out(&mut row);
        assert!(row[0] > 0 && row[99] > 0);
    }
}
