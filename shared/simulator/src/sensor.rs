//! A sweep of a spinning FMCW radar, each azimuth measured at its own time from its own pose.
//!
//! Echoes are summed as complex amplitudes with the phase of their true path, so scatterers in one
//! resolution cell interfere (speckle), differently from each pose. Noise is the receiver's alone.

mod antenna;
mod echoes;
mod line_of_sight;
pub mod spectrum;
mod sweep_poses;

use std::f64::consts::TAU;

use gyre_geometry::{ScanSlot, Sense, SweepGeometry, scan::flag};
use rand::Rng;
use rand_chacha::ChaCha8Rng;
use rand_distr::StandardNormal;
use serde::{Deserialize, Serialize};

pub use self::antenna::Antenna;
use self::antenna::interpolate;
pub use self::sweep_poses::SweepTime;
use self::{
    echoes::{BeamIndex, Echo, View},
    line_of_sight::LineOfSight,
    spectrum::{NOISE_OVERLAP, RangeSpectrum},
    sweep_poses::SweepPoses,
};
use crate::{
    body::Moving,
    path::Path,
    profile::{Chirp, METADATA_BYTES, Profile, Receiver, Sampling},
    stream::Stream,
    world::World,
};

/// Encoder counts from one azimuth to the next of a radar with another number of azimuths than its
/// profile.
const ENCODER_STEP: u16 = 14;
/// Size of each azimuth's part of a scan's random numbers, in words.
const WORDS_PER_AZIMUTH: u128 = 1 << 24;
/// Share of azimuths that are lost.
const DROPPED: f64 = 0.002;
/// Jitter of the encoder, standard deviation, radians: a third of a count.
const ENCODER_JITTER_RAD: f64 = 3.7e-4;

/// The surroundings of the sensor during a sweep.
#[derive(Clone, Copy)]
pub struct Scene<'a> {
    pub world: &'a World,
    /// The moving bodies near the sensor, at the middle of the sweep.
    pub movers: &'a [Moving<'a>],
    pub path: &'a dyn Path,
    /// True if the radome is blocked, so that no echo passes.
    pub blind: bool,
}

/// A radar with its working memory.
#[derive(Clone, Debug)]
pub struct Sensor {
    seed: u64,
    eccentricity_rad: f64,
    is_exact: bool,
    sampling: Sampling,
    receiver: Receiver,
    antenna: Antenna,
    spectrum: RangeSpectrum,
    noise: Vec<f32>,
    sweep_poses: SweepPoses,
    line_of_sight: LineOfSight,
    echoes: Vec<Echo>,
    beams: BeamIndex,
}

impl Sensor {
    /// A new radar, without errors if it is exact. All its randomness comes from `seed`.
    pub fn new(config: &SensorConfig, is_exact: bool, seed: u64) -> Self {
        let (sampling, receiver) = (config.sampling(), config.receiver());
        let spectrum = RangeSpectrum::new(sampling.bins, sampling.range_resolution_m, &receiver);
        let (cells, spacing) = spectrum.noise_cells();
        let power = |cell: usize| {
            let range_m = sampling.range_m(cell as f64 * spacing).max(0.0);
            let floor_db = interpolate(receiver.floor_db, range_m);
            10f32.powf((floor_db + config.noise_db) as f32 / 10.0)
        };
        Self {
            seed,
            eccentricity_rad: config.azimuth_eccentricity_rad,
            is_exact,
            antenna: Antenna::new(receiver.beam_rad),
            noise: (0..cells).map(power).collect(),
            spectrum,
            sweep_poses: SweepPoses::default(),
            line_of_sight: LineOfSight::default(),
            echoes: Vec::new(),
            beams: BeamIndex::default(),
            sampling,
            receiver,
        }
    }

    /// Measures one sweep into `slot` and returns its geometry: rows of [`METADATA_BYTES`], then
    /// powers, as in an Oxford image.
    /// All randomness comes from the radar's seed and `index`, the number of the scan.
    pub fn sweep(
        &mut self,
        scene: Scene<'_>,
        time: SweepTime,
        index: u64,
        slot: &mut ScanSlot<'_>,
    ) -> SweepGeometry {
        let mut rng = Stream::scan(index).generator(self.seed);
        self.collect_echoes(scene, time);
        for azimuth in 0..self.sampling.azimuths {
            rng.set_word_pos((azimuth as u128 + 1) * WORDS_PER_AZIMUTH);
            self.measure(azimuth, &mut rng);
            self.write_row(azimuth, time, slot);
        }
        if !self.is_exact {
            self.drop_azimuths(&mut rng, slot);
        }
        self.geometry(time)
    }

    fn collect_echoes(&mut self, scene: Scene<'_>, time: SweepTime) {
        let error_rad = |azimuth_rad: f64| self.eccentricity_rad * azimuth_rad.cos();
        self.sweep_poses
            .sample(scene.path, time, &self.sampling, error_rad);
        let reach_m = self.sampling.reach_m();
        self.line_of_sight.cast(&scene, &self.sweep_poses, reach_m);
        self.echoes.clear();
        if !scene.blind {
            let view = View {
                sweep_poses: &self.sweep_poses,
                line_of_sight: &self.line_of_sight,
                receiver: &self.receiver,
                fluctuates: !self.is_exact,
                reach_m,
            };
            view.standing(scene.world, &mut self.echoes);
            view.moving(scene.movers, &mut self.echoes);
        }
        self.beams
            .sort(&self.echoes, &self.antenna, &self.sweep_poses);
    }

    fn measure(&mut self, azimuth: usize, rng: &mut ChaCha8Rng) {
        let azimuth_pose = *self.sweep_poses.at(azimuth as f64);
        let doppler_s = self.doppler_s(azimuth);
        let wavelength_m = self.receiver.wavelength_m();
        let jitter_rad = match self.is_exact {
            true => 0.0,
            false => ENCODER_JITTER_RAD * rng.sample::<f64, _>(StandardNormal),
        };
        self.spectrum.clear();
        for &number in self.beams.echoes(azimuth) {
            let echo = &self.echoes[number as usize];
            let ray = echo.place(&azimuth_pose) - azimuth_pose.position;
            let range_m = ray.norm();
            // Small angles: the tangent is the angle.
            let off_rad = azimuth_pose.beam.perp(&ray) / azimuth_pose.beam.dot(&ray) + jitter_rad;
            let amplitude = echo.amplitude * self.antenna.gain(off_rad);
            let approach_mps = (azimuth_pose.velocity - echo.velocity).dot(&ray) / range_m;
            // With a rising chirp approaching targets are measured too near.
            let bin = self.sampling.bin(range_m - doppler_s * approach_mps);
            if self.is_exact {
                self.spectrum.add_power(bin, (amplitude * amplitude) as f32);
            } else {
                // Two-way: two wavelengths of phase for each wavelength of range.
                let (sine, cosine) = (TAU * (2.0 * range_m / wavelength_m).fract()).sin_cos();
                self.spectrum
                    .add(bin, (amplitude * cosine) as f32, (amplitude * sine) as f32);
            }
        }
        if !self.is_exact {
            self.add_noise(rng);
        }
    }

    fn add_noise(&mut self, rng: &mut ChaCha8Rng) {
        let (_, spacing) = self.spectrum.noise_cells();
        for (cell, mean) in self.noise.iter().enumerate() {
            let deviation = (mean / (2.0 * NOISE_OVERLAP)).sqrt();
            let (real, imaginary): (f32, f32) =
                (rng.sample(StandardNormal), rng.sample(StandardNormal));
            self.spectrum.add(
                cell as f64 * spacing,
                deviation * real,
                deviation * imaginary,
            );
        }
    }

    fn doppler_s(&self, azimuth: usize) -> f64 {
        match self.sampling.chirp {
            Chirp::Rising => self.sampling.doppler_s,
            Chirp::Alternating if azimuth.is_multiple_of(2) => self.sampling.doppler_s,
            Chirp::Alternating => -self.sampling.doppler_s,
        }
    }

    fn write_row(&self, azimuth: usize, time: SweepTime, slot: &mut ScanSlot<'_>) {
        let stride = self.sampling.stride();
        let row = &mut slot.bytes[azimuth * stride..(azimuth + 1) * stride];
        let (stamp_us, encoder) = (time.stamp_us(azimuth), self.sampling.encoder_count(azimuth));
        let (state, flags) = match self.sampling.chirp {
            Chirp::Alternating if azimuth.is_multiple_of(2) => {
                (255, flag::MEASURED | flag::CHIRP_KNOWN | flag::CHIRP_UP)
            }
            Chirp::Alternating => (0, flag::MEASURED | flag::CHIRP_KNOWN),
            _ => (255, flag::MEASURED),
        };
        row[..8].copy_from_slice(&stamp_us.to_le_bytes());
        row[8..10].copy_from_slice(&encoder.to_le_bytes());
        row[10] = state;
        self.spectrum.read_out(&mut row[METADATA_BYTES..]);
        slot.azimuth_rad[azimuth] = self.sampling.azimuth_rad(azimuth) as f32;
        slot.stamp_ns[azimuth] = stamp_us * 1000;
        slot.flags[azimuth] = flags;
    }

    /// Replaces lost azimuths by the mean of their neighbours, and marks them where the format can.
    fn drop_azimuths(&self, rng: &mut ChaCha8Rng, slot: &mut ScanSlot<'_>) {
        let stride = self.sampling.stride();
        rng.set_word_pos(WORDS_PER_AZIMUTH / 2);
        for azimuth in 1..self.sampling.azimuths - 1 {
            if !rng.random_bool(DROPPED) || self.sampling.chirp == Chirp::Alternating {
                continue;
            }
            for byte in METADATA_BYTES..stride {
                let at = |azimuth: usize| u16::from(slot.bytes[azimuth * stride + byte]);
                slot.bytes[azimuth * stride + byte] =
                    ((at(azimuth - 1) + at(azimuth + 1)) / 2) as u8;
            }
            slot.bytes[azimuth * stride + METADATA_BYTES - 1] = 0;
            slot.flags[azimuth] = 0;
        }
    }

    fn geometry(&self, time: SweepTime) -> SweepGeometry {
        let Sampling {
            azimuths,
            bins,
            range_resolution_m,
            range_offset_m,
            ..
        } = self.sampling;
        SweepGeometry {
            azimuths,
            bins,
            stride: self.sampling.stride(),
            first_byte: METADATA_BYTES,
            range_resolution_m: range_resolution_m as f32,
            range_offset_m: range_offset_m as f32,
            doppler_s: self.doppler_s(0) as f32,
            sense: Sense::Clockwise,
            stamp_ns: (time.start_us + time.stamp_us(azimuths - 1)) * 500,
        }
    }
}

/// The radar: a known radar, and the values that differ from its profile.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct SensorConfig {
    /// The radar. Default: `cts350x-oxford`.
    pub profile: Profile,
    /// The seed of noise, speckle and losses, for another drive through the same streets. Default:
    /// the seed of the simulation.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub seed: Option<u64>,
    /// Range bins of an azimuth. Default: the profile's.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub bins: Option<usize>,
    /// Length of a bin, metres. Default: the profile's.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub bin_m: Option<f64>,
    /// Azimuths of a turn. Default: the profile's.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub azimuths: Option<usize>,
    /// Time of one turn, seconds. Default: the profile's.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub period_s: Option<f64>,
    /// Two-way half-power width of the beam, degrees. Default: the profile's.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub beam_deg: Option<f64>,
    /// Excess of the receiver's noise over its profile, decibels.
    pub noise_db: f64,
    /// Metres to add to a bin's range. Default: the profile's.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub range_offset_m: Option<f64>,
    /// Doppler shift: metres of range for each m/s of closing speed; 0 for a radar without the
    /// effect. Default: the profile's.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub doppler_s: Option<f64>,
    /// Eccentricity of the encoder's disc, radians: the beam points to `azimuth + eccentricity *
    /// cos(azimuth)`, which `dataset.azimuth_eccentricity_rad` corrects.
    pub azimuth_eccentricity_rad: f64,
    /// True if the host loses azimuths, as the one of RADIATE did: the columns behind them move up,
    /// and the last ones are of the scan before. Only for `output.format = "radiate"`.
    pub lost_azimuths: bool,
}

impl SensorConfig {
    pub fn receiver(&self) -> Receiver {
        let kind = self.profile.receiver();
        Receiver {
            beam_rad: self.beam_deg.map_or(kind.beam_rad, f64::to_radians),
            // A bin is at most as long as the radar's resolution.
            cell_m: kind.cell_m.max(self.bin_m.unwrap_or(0.0)),
            ..kind
        }
    }

    pub fn sampling(&self) -> Sampling {
        let mut sampling = self.profile.sampling();
        if let Some(azimuths) = self.azimuths.filter(|count| *count != sampling.azimuths) {
            sampling.azimuths = azimuths;
            sampling.encoder_step = ENCODER_STEP;
            sampling.encoder_counts = (azimuths as u16).saturating_mul(ENCODER_STEP);
            sampling.encoder_first = 0;
        }
        Sampling {
            bins: self.bins.unwrap_or(sampling.bins),
            range_resolution_m: self.bin_m.unwrap_or(sampling.range_resolution_m),
            period_us: self.period_s.map_or(sampling.period_us, |period_s| {
                (period_s * 1e6).round() as i64
            }),
            range_offset_m: self.range_offset_m.unwrap_or(sampling.range_offset_m),
            doppler_s: self.doppler_s.unwrap_or(sampling.doppler_s),
            ..sampling
        }
    }
}
