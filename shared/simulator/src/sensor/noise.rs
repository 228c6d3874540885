//! All power that no echo explains: the receiver's noise, ringing, weather, phase noise, lines, other radars.

use rand::Rng;

use super::effects::Effects;
use super::spectrum::{NOISE_OVERLAP, RangeSpectrum};
use crate::profile::{Receiver, Sampling};

/// Metres a cell of the coarse profile of power from which phase noise is reckoned.
const COARSE_M: f64 = 2.0;
/// Phase noise far beside an echo: power in each bin as a share of the echo's, as measured on Oxford's and RADIATE's scans
/// (the lower fifth of an azimuth's powers rises with their sum).
const SKIRT: f64 = 1.0e-6;
/// How much more of it there is at the echo itself, and the distance at which that falls to one half, metres.
const SKIRT_PEAK: f64 = 50.0;
const SKIRT_WIDTH_M: f64 = 1.5;
/// Spurious lines: range as a share of the farthest, and power in units of the floor there.
const LINES: [(f64, f64); 4] = [(0.069, 0.5), (0.164, 0.6), (0.37, 0.9), (0.55, 0.7)];
/// Times a scan that another radar is heard, on average.
const BURSTS_A_SCAN: f64 = 0.6;
/// Most azimuths that one burst lasts.
const BURST_AZIMUTHS: std::ops::RangeInclusive<usize> = 1..=4;
/// How far bursts stand above the floor, dB.
const BURST_DB: std::ops::Range<f64> = 3.0..22.0;

/// Another radar, heard from some azimuth on.
#[derive(Clone, Copy, Debug)]
struct Burst {
    first: usize,
    azimuths: usize,
    /// Power in units of the floor.
    strength: f64,
}

/// Noise of one sweep.
#[derive(Clone, Debug)]
pub(super) struct Noise {
    /// Mean power in each noise cell without any echo.
    floor: Vec<f64>,
    /// Mean power of rain, fog and snow in each noise cell, as received.
    clutter: Vec<f64>,
    /// Noise cell to coarse cell.
    coarse_of: Vec<usize>,
    /// Power of echoes in each coarse cell of the azimuth at hand, and the noise that it brings there.
    echoes: Vec<f64>,
    raised: Vec<f64>,
    skirt: Vec<f64>,
    bursts: Vec<Burst>,
    snow: bool,
}

impl Noise {
    pub fn new(sampling: &Sampling, receiver: &Receiver, effects: &Effects, spectrum: &RangeSpectrum) -> Self {
        let (cells, spacing) = spectrum.noise_cells();
        let range_m = |cell: usize| sampling.range_m(cell as f64 * spacing).max(0.0);
        let mut floor: Vec<f64> = (0..cells).map(|cell| floor_power(range_m(cell), receiver, effects)).collect();
        if effects.spurious_lines {
            for (share, power) in LINES {
                let cell = (share * cells as f64) as usize;
                floor[cell] *= 1.0 + power;
            }
        }
        let coarse = (sampling.reach_m() / COARSE_M) as usize + 2;
        let skirt_at = |i: usize| SKIRT * (1.0 + SKIRT_PEAK / (1.0 + (i as f64 * COARSE_M / SKIRT_WIDTH_M).powi(2)));
        Self {
            floor,
            clutter: vec![0.0; cells],
            coarse_of: (0..cells).map(|cell| (range_m(cell) / COARSE_M) as usize).collect(),
            echoes: vec![0.0; coarse],
            raised: vec![0.0; coarse],
            skirt: (0..coarse).map(skirt_at).collect(),
            bursts: Vec::new(),
            snow: false,
        }
    }

    /// Settles what holds for a whole sweep. `clutter` gives the power from a resolution cell at a range.
    pub fn begin_sweep(
        &mut self,
        sampling: &Sampling,
        spectrum: &RangeSpectrum,
        interference: bool,
        snow: bool,
        clutter: impl Fn(f64) -> f64,
        rng: &mut impl Rng,
    ) {
        let (_, spacing) = spectrum.noise_cells();
        for (cell, power) in self.clutter.iter_mut().enumerate() {
            *power = clutter(sampling.range_m(cell as f64 * spacing).max(0.5));
        }
        self.snow = snow;
        self.bursts.clear();
        // A Poisson process, one exponential gap after another.
        let mut at = -(1.0 - rng.random::<f64>()).ln();
        while interference && at < BURSTS_A_SCAN {
            self.bursts.push(Burst {
                first: rng.random_range(0..sampling.azimuths),
                azimuths: rng.random_range(BURST_AZIMUTHS),
                strength: 10f64.powf(rng.random_range(BURST_DB) / 10.0),
            });
            at -= (1.0 - rng.random::<f64>()).ln();
        }
    }

    /// Forgets the azimuth before.
    pub fn begin_azimuth(&mut self) {
        self.echoes.fill(0.0);
    }

    /// Notes an echo's power.
    pub fn note(&mut self, range_m: f64, power: f64) {
        if let Some(cell) = self.echoes.get_mut((range_m.max(0.0) / COARSE_M) as usize) {
            *cell += power;
        }
    }

    /// Adds complex Gaussian noise to the spectrum of an azimuth: exponentially distributed power about its mean.
    pub fn add(&mut self, spectrum: &mut RangeSpectrum, azimuth: usize, phase_noise: bool, rng: &mut impl Rng) {
        self.raised.fill(0.0);
        if phase_noise {
            self.spread_skirts();
        }
        let heard = |burst: &&Burst| (burst.first..burst.first + burst.azimuths).contains(&azimuth);
        let burst = 1.0 + self.bursts.iter().filter(heard).map(|burst| burst.strength).sum::<f64>();
        let (_, spacing) = spectrum.noise_cells();
        for (cell, floor) in self.floor.iter().enumerate() {
            let mut clutter = self.clutter[cell];
            if self.snow && clutter > 0.0 {
                // Flakes come in clumps: power that is spread exponentially about a mean that itself is.
                clutter *= -(1.0 - rng.random::<f64>()).ln();
            }
            let mean = (floor * burst + clutter + self.raised[self.coarse_of[cell]]) as f32 / NOISE_OVERLAP;
            let amplitude = (-mean * (1.0 - rng.random::<f32>()).ln()).sqrt();
            let (sine, cosine) = (std::f32::consts::TAU * rng.random::<f32>()).sin_cos();
            spectrum.add(cell as f64 * spacing, amplitude * cosine, amplitude * sine);
        }
    }

    fn spread_skirts(&mut self) {
        for (from, &power) in self.echoes.iter().enumerate().filter(|(_, power)| **power > 0.0) {
            for (to, raised) in self.raised.iter_mut().enumerate() {
                *raised += power * self.skirt[from.abs_diff(to)];
            }
        }
    }
}

fn floor_power(range_m: f64, receiver: &Receiver, effects: &Effects) -> f64 {
    let power = |on: bool, table: &[(f64, f64)], beyond: f64| match on {
        true => interpolate(table, range_m, beyond).map_or(0.0, |db| 10f64.powf(db / 10.0)),
        false => 0.0,
    };
    power(effects.noise, receiver.floor_db, f64::INFINITY)
        + power(effects.ringing, receiver.ringing_db, receiver.ringing_db.last().map_or(0.0, |last| last.0))
}

/// Between the entries of a table; the first one's value before it, the last one's behind it, nothing beyond `end`.
fn interpolate(table: &[(f64, f64)], at: f64, end: f64) -> Option<f64> {
    let (first, last) = (table.first()?, table.last()?);
    if at > end {
        return None;
    }
    let next = table.partition_point(|entry| entry.0 <= at);
    Some(match next {
        0 => first.1,
        _ if next == table.len() => last.1,
        _ => {
            let ((x0, y0), (x1, y1)) = (table[next - 1], table[next]);
            y0 + (y1 - y0) * (at - x0) / (x1 - x0)
        }
    })
}
