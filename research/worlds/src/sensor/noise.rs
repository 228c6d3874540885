//! All power that is no single echo: thermal noise, ground, weather, phase noise, reverberation,
//! spurious lines, interference.

use std::f64::consts::TAU;

use rand::Rng;
use rand_distr::StandardNormal;

use super::effects::Effects;
use super::spectrum::{NOISE_OVERLAP, RangeSpectrum};
use super::sweep_poses::SweepPoses;
use crate::interpolate::interpolate;
use crate::place_noise::smooth_noise;
use crate::profile::{Receiver, Sampling};

/// Length of a cell of the coarse power profile for phase noise and reverberation, metres.
const COARSE_M: f64 = 2.0;
/// Phase noise far from an echo: power in each bin as a share of the echo's, measured in Oxford's
/// and RADIATE's scans (the lower fifth of an azimuth's powers rises with their sum).
const SKIRT: f64 = 1.0e-6;
/// Factor of the phase noise at the echo itself, and the distance at which it has fallen to one
/// half, metres.
const SKIRT_PEAK: f64 = 100.0;
const SKIRT_WIDTH_M: f64 = 1.5;
/// Reverberation: share of an echo's power, and exponential decay length, metres. First what lies
/// behind a front (rooms, eaves, near objects), then a whole street, which a beam also receives
/// from neighbouring azimuths.
const TAIL: [(f64, f64); 2] = [(2.0e-3, 1.5), (2.0e-5, 10.0)];
const STREET: (f64, f64) = (2.5e-6, 50.0);
const STREET_AZIMUTHS: usize = 4;
/// Variation of reverberation between directions, standard deviation, dB: the part that belongs to
/// the place, and the part that is new in each sweep.
const LIVELINESS_DB: f64 = 8.0;
const STIRRED_DB: f64 = 7.0;
/// Number of directions, and the distance over which each changes, metres.
const REVERBERATION_SECTORS: u64 = 60;
const REVERBERATION_M: f64 = 4.0;
/// Spurious lines: range as a share of the maximum, and power in units of the floor there.
const LINES: [(f64, f64); 4] = [(0.069, 0.5), (0.164, 0.6), (0.37, 0.9), (0.55, 0.7)];
/// Mean number of interference bursts in a scan.
const BURSTS_A_SCAN: f64 = 0.6;
/// Length of a burst, azimuths.
const BURST_AZIMUTHS: std::ops::RangeInclusive<usize> = 1..=4;
/// Power of bursts above the floor, dB.
const BURST_DB: std::ops::Range<f64> = 3.0..22.0;

/// An interference burst.
#[derive(Clone, Copy, Debug)]
struct Burst {
    first: usize,
    azimuths: usize,
    /// Power in units of the floor.
    strength: f64,
}

/// The noise of one sweep.
#[derive(Clone, Debug)]
pub(super) struct Noise {
    /// Mean power of the thermal noise in each noise cell.
    floor: Vec<f64>,
    /// Factor on it without any echo: 1, more at spurious lines.
    steady: Vec<f64>,
    /// Mean received power of rain, fog and snow in each noise cell.
    clutter: Vec<f64>,
    /// Mean power of the ground in each coarse cell of the current azimuth.
    ground: Vec<f64>,
    /// Noise cell to coarse cell.
    coarse_of: Vec<usize>,
    /// Power of echoes in each coarse cell of the current azimuth, and the noise that results.
    echoes: Vec<f64>,
    raised: Vec<f64>,
    /// Power of echoes in each coarse cell of all azimuths, azimuth by azimuth; and its mean over
    /// the azimuths from which a street reverberates.
    around: Vec<f64>,
    street: Vec<f64>,
    /// Phase noise by the distance from an echo, in coarse cells, and reverberation by the distance
    /// behind it, at the front and along the street, as shares of the echo's power.
    skirt: Vec<f64>,
    tail: Vec<f64>,
    street_tail: Vec<f64>,
    /// Factor on the reverberation of each azimuth.
    liveliness: Vec<f64>,
    bursts: Vec<Burst>,
    snow: bool,
}

impl Noise {
    pub fn new(
        sampling: &Sampling,
        receiver: &Receiver,
        effects: &Effects,
        spectrum: &RangeSpectrum,
    ) -> Self {
        let (cells, spacing) = spectrum.noise_cells();
        let range_m = |cell: usize| sampling.range_m(cell as f64 * spacing).max(0.0);
        let power = |db: f64| 10f64.powf(db / 10.0);
        let floor_at =
            |cell: usize| interpolate(receiver.floor_db, range_m(cell)).map_or(0.0, power);
        let mut steady = vec![if effects.noise { 1.0 } else { 0.0 }; cells];
        if effects.spurious_lines {
            for (share, power) in LINES {
                steady[(share * cells as f64) as usize] += power;
            }
        }
        let coarse = (sampling.reach_m() / COARSE_M) as usize + 2;
        let skirt_at = |i: usize| {
            SKIRT * (1.0 + SKIRT_PEAK / (1.0 + (i as f64 * COARSE_M / SKIRT_WIDTH_M).powi(2)))
        };
        let behind = |i: usize, (share, length_m): (f64, f64)| {
            share * (-(i as f64) * COARSE_M / length_m).exp()
        };
        let on = if effects.reverberation { 1.0 } else { 0.0 };
        Self {
            floor: (0..cells).map(floor_at).collect(),
            steady,
            clutter: vec![0.0; cells],
            ground: vec![0.0; coarse],
            coarse_of: (0..cells)
                .map(|cell| (range_m(cell) / COARSE_M) as usize)
                .collect(),
            echoes: vec![0.0; coarse],
            raised: vec![0.0; coarse],
            skirt: (0..coarse)
                .map(|i| {
                    if effects.phase_noise {
                        skirt_at(i)
                    } else {
                        0.0
                    }
                })
                .collect(),
            tail: (0..coarse)
                .map(|i| on * TAIL.map(|tail| behind(i, tail)).iter().sum::<f64>())
                .collect(),
            street_tail: (0..coarse).map(|i| on * behind(i, STREET)).collect(),
            around: vec![0.0; coarse * sampling.azimuths],
            street: vec![0.0; coarse * sampling.azimuths],
            liveliness: vec![1.0; sampling.azimuths],
            bursts: Vec::new(),
            snow: false,
        }
    }

    /// Prepares a sweep. `clutter` gives the power from a resolution cell of the atmosphere at a
    /// range.
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
        // A Poisson process: exponential gaps.
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

    /// Draws the reverberation of each direction: log-normal, by place and direction. A part is new
    /// in each sweep, as from moving leaves and opened doors.
    pub fn draw_reverberation(&mut self, sweep_poses: &SweepPoses, rng: &mut impl Rng) {
        let stirred: Vec<f64> = (0..REVERBERATION_SECTORS)
            .map(|_| STIRRED_DB * rng.sample::<f64, _>(StandardNormal))
            .collect();
        for (azimuth, liveliness) in self.liveliness.iter_mut().enumerate() {
            let azimuth_pose = sweep_poses.at(azimuth as f64);
            let sector = azimuth_pose
                .beam
                .y
                .atan2(azimuth_pose.beam.x)
                .rem_euclid(TAU)
                / TAU
                * REVERBERATION_SECTORS as f64;
            let (first, share) = (sector as u64 % REVERBERATION_SECTORS, sector.fract());
            let db = |sector: u64| {
                LIVELINESS_DB * smooth_noise(azimuth_pose.position, REVERBERATION_M, sector)
                    + stirred[sector as usize]
            };
            let both = db(first) * (1.0 - share) + db((first + 1) % REVERBERATION_SECTORS) * share;
            *liveliness = 10f64.powf(both / 10.0);
        }
    }

    /// Collects the echoes of a sweep: azimuth, range in metres, and power.
    pub fn collect_powers(&mut self, echoes: impl Iterator<Item = (f64, f64, f64)>) {
        let (coarse, azimuths) = (self.echoes.len(), self.liveliness.len());
        self.around.fill(0.0);
        for (azimuth, range_m, power) in echoes {
            let (azimuth, cell) = (
                azimuth.round() as i64,
                (range_m.max(0.0) / COARSE_M) as usize,
            );
            if cell < coarse {
                self.around[azimuth.rem_euclid(azimuths as i64) as usize * coarse + cell] += power;
            }
        }
        self.street.fill(0.0);
        for azimuth in 0..azimuths {
            let from = &self.around[azimuth * coarse..(azimuth + 1) * coarse];
            for beside in 0..=2 * STREET_AZIMUTHS {
                let to = (azimuth + azimuths + beside - STREET_AZIMUTHS) % azimuths;
                let to = &mut self.street[to * coarse..(to + 1) * coarse];
                to.iter_mut()
                    .zip(from)
                    .for_each(|(to, from)| *to += from / (2 * STREET_AZIMUTHS + 1) as f64);
            }
        }
    }

    /// Prepares an azimuth. `ground` gives the power from a resolution cell of the ground at a
    /// range.
    pub fn begin_azimuth(&mut self, ground: impl Fn(f64) -> f64) {
        self.echoes.fill(0.0);
        for (cell, power) in self.ground.iter_mut().enumerate() {
            *power = ground((cell as f64 + 0.5) * COARSE_M);
        }
    }

    /// Adds an echo of the current azimuth.
    pub fn add_echo(&mut self, range_m: f64, power: f64) {
        if let Some(cell) = self.echoes.get_mut((range_m.max(0.0) / COARSE_M) as usize) {
            *cell += power;
        }
    }

    /// Adds the noise to the spectrum of an azimuth.
    pub fn add(&mut self, spectrum: &mut RangeSpectrum, azimuth: usize, rng: &mut impl Rng) {
        self.spread_echoes(azimuth);
        let power_of =
            |burst: &&Burst| (burst.first..burst.first + burst.azimuths).contains(&azimuth);
        let burst = self
            .bursts
            .iter()
            .filter(power_of)
            .map(|burst| burst.strength)
            .sum::<f64>();
        let (_, spacing) = spectrum.noise_cells();
        for (cell, floor) in self.floor.iter().enumerate() {
            let clutter = if self.snow { 0.0 } else { self.clutter[cell] };
            let coarse = self.coarse_of[cell];
            let mean = floor * (self.steady[cell] + burst)
                + clutter
                + self.ground[coarse]
                + self.raised[coarse];
            add_gaussian(spectrum, cell as f64 * spacing, mean, rng);
        }
        if self.snow {
            for (cell, clutter) in self.clutter.iter().enumerate() {
                // Snow is clumped: exponentially distributed power about an exponentially
                // distributed mean.
                let clump = -(1.0 - rng.random::<f64>()).ln();
                add_gaussian(spectrum, cell as f64 * spacing, clump * clutter, rng);
            }
        }
    }

    fn spread_echoes(&mut self, azimuth: usize) {
        let (liveliness, coarse) = (self.liveliness[azimuth], self.echoes.len());
        self.raised.fill(0.0);
        for (from, &power) in self.street[azimuth * coarse..][..coarse]
            .iter()
            .enumerate()
            .filter(|(_, power)| **power > 0.0)
        {
            for (raised, tail) in self.raised[from..].iter_mut().zip(&self.street_tail) {
                *raised += liveliness * power * tail;
            }
        }
        for (from, &power) in self
            .echoes
            .iter()
            .enumerate()
            .filter(|(_, power)| **power > 0.0)
        {
            let (before, behind) = self.raised.split_at_mut(from);
            for (raised, skirt) in before.iter_mut().rev().zip(&self.skirt[1..]) {
                *raised += power * skirt;
            }
            for ((raised, skirt), tail) in behind.iter_mut().zip(&self.skirt).zip(&self.tail) {
                *raised += power * (skirt + liveliness * tail);
            }
        }
    }
}

/// Adds one cell's complex Gaussian noise with a mean power in each bin.
fn add_gaussian(spectrum: &mut RangeSpectrum, bin: f64, mean: f64, rng: &mut impl Rng) {
    let deviation = (mean as f32 / (2.0 * NOISE_OVERLAP)).sqrt();
    let (real, imaginary): (f32, f32) = (rng.sample(StandardNormal), rng.sample(StandardNormal));
    spectrum.add(bin, deviation * real, deviation * imaginary);
}
