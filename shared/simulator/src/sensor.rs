//! A sweep of a spinning FMCW radar, each azimuth measured at its own time from its own pose.
//!
//! In the order in which a sweep comes about:
//!
//! - `stations`: where the sensor is at each azimuth, and when its beam passes a place,
//! - `skyline`: rays to all sides, and the walls that each passes,
//! - `echoes`, `highlights`, `ghosts`: what can be seen, directly, as a gliding spot on a wall, and mirrored, and how strongly; `atmosphere`: what the weather takes,
//! - `scintillation`: how they flicker as they are passed,
//! - `elevation`: how much of each the beam has, being a few degrees high; `antenna`: how much of it each azimuth's beam takes in,
//! - `spectrum`: what range processing and quantisation make of it,
//! - `ground`: what the road and the fields send back,
//! - `carrier`: what turns with the radar, its ringing and its vehicle; `noise`: all that no echo explains,
//! - `effects`: each of these on or off.
//!
//! Echoes are summed as complex amplitudes with the phase of their true path, so that scatterers in one resolution
//! cell interfere (speckle), and do so differently from the next pose. Not modelled: heights other than by chance, ways
//! that bounce once.

mod antenna;
mod atmosphere;
mod beam_index;
mod carrier;
mod config;
mod echoes;
pub mod effects;
mod elevation;
mod ghosts;
mod ground;
mod highlights;
mod noise;
mod place_noise;
mod scintillation;
mod skyline;
pub mod spectrum;
mod stations;
mod sweep_time;

use std::f64::consts::TAU;

use gyre_radar::scan::flag;
use gyre_radar::{ScanSlot, Sense, SweepGeometry};
use rand::Rng;
use rand_chacha::ChaCha8Rng;
use rand_distr::StandardNormal;

use self::antenna::Antenna;
use self::atmosphere::Atmosphere;
use self::beam_index::BeamIndex;
use self::carrier::Carrier;
pub use self::config::SensorConfig;
use self::echoes::{Echo, View};
pub use self::effects::Effects;
use self::elevation::Nodding;
use self::noise::Noise;
use self::skyline::Skyline;
use self::spectrum::RangeSpectrum;
use self::stations::Stations;
pub use self::sweep_time::SweepTime;
use crate::body::{Movers, Moving};
use crate::path::Path;
use crate::profile::{Chirp, METADATA_BYTES, Receiver, Sampling};
use crate::stream::Stream;
use crate::weather::WeatherConfig;
use crate::world::World;

/// Each azimuth has a part of its own of a scan's random numbers.
const WORDS_AN_AZIMUTH: u128 = 1 << 24;
/// Share of azimuths that are lost.
const DROPPED: f64 = 0.002;
/// Jitter of the encoder, standard deviation, radians: a third of a count.
const ENCODER_JITTER_RAD: f64 = 3.7e-4;

/// What is to be measured.
#[derive(Clone, Copy)]
pub struct Scene<'a> {
    /// What stands.
    pub world: &'a World,
    /// What moves.
    pub movers: &'a dyn Movers,
    /// How the sensor moves.
    pub path: &'a dyn Path,
    /// What the weather is like.
    pub weather: WeatherConfig,
}

/// The radar, with its working memory.
#[derive(Clone, Debug)]
pub struct Sensor {
    config: SensorConfig,
    seed: u64,
    effects: Effects,
    sampling: Sampling,
    receiver: Receiver,
    antenna: Antenna,
    spectrum: RangeSpectrum,
    noise: Noise,
    carrier: Carrier,
    nodding: Nodding,
    stations: Stations,
    skyline: Skyline,
    echoes: Vec<Echo>,
    beams: BeamIndex,
    jitter_rad: Vec<f64>,
}

impl Sensor {
    /// A radar that has seen nothing yet. All its randomness comes from `seed`.
    pub fn new(config: &SensorConfig, effects: &Effects, seed: u64) -> Self {
        let (sampling, receiver) = (config.sampling(), config.profile.receiver());
        let spectrum = RangeSpectrum::new(sampling.bins, sampling.range_resolution_m, &receiver);
        Self {
            antenna: Antenna::new(receiver.beam_rad, effects.side_lobes),
            noise: Noise::new(&sampling, &receiver, effects, &spectrum),
            carrier: Carrier::new(&sampling, &receiver, effects, &spectrum, seed),
            nodding: Nodding::new(seed),
            spectrum,
            seed,
            stations: Stations::default(),
            skyline: Skyline::default(),
            echoes: Vec::new(),
            beams: BeamIndex::default(),
            jitter_rad: vec![0.0; sampling.azimuths],
            config: config.clone(),
            effects: *effects,
            sampling,
            receiver,
        }
    }

    /// How it samples.
    pub fn sampling(&self) -> &Sampling {
        &self.sampling
    }

    /// Measures one sweep into `slot` and says how it lies there: rows of [`METADATA_BYTES`], then powers, as in an Oxford image.
    ///
    /// Its randomness comes from the radar's seed and `index`, the number of the scan.
    pub fn sweep(
        &mut self,
        scene: Scene<'_>,
        time: SweepTime,
        index: u64,
        slot: &mut ScanSlot<'_>,
    ) -> SweepGeometry {
        let mut rng = Stream::Scan(index).generator(self.seed);
        self.look_around(scene, time, &mut rng);
        for azimuth in 0..self.sampling.azimuths {
            rng.set_word_pos((azimuth as u128 + 1) * WORDS_AN_AZIMUTH);
            self.measure(azimuth, &mut rng);
            self.write_row(azimuth, time, slot);
        }
        if self.effects.dropped_azimuths {
            self.drop_azimuths(&mut rng, slot);
        }
        self.geometry(time)
    }

    /// Lists all that the sweep sees.
    fn look_around(&mut self, scene: Scene<'_>, time: SweepTime, rng: &mut ChaCha8Rng) {
        let wobble_rad = if self.effects.encoder_wobble {
            self.config.azimuth_eccentricity_rad
        } else {
            0.0
        };
        let moving = self.effects.sweep_motion;
        let error_rad = |azimuth_rad: f64| wobble_rad * azimuth_rad.cos();
        let lift_rad = |time_s, azimuth_rad| self.nodding.lift_rad(time_s, azimuth_rad);
        self.stations.follow(
            scene.path,
            time,
            &self.sampling,
            moving,
            error_rad,
            lift_rad,
        );
        let middle_s = time.drive_time_s(time.middle_us());
        let centre = self.stations.middle().position;
        let reach_m = self.sampling.reach_m();
        let mut movers: Vec<Moving<'_>> = Vec::new();
        scene
            .movers
            .visit(middle_s, centre, reach_m, &mut |mover| movers.push(mover));
        self.skyline
            .cast(scene.world, &movers, &self.stations, reach_m);
        let weather = if self.effects.weather {
            scene.weather
        } else {
            WeatherConfig::default()
        };
        let atmosphere = Atmosphere::new(&weather, self.receiver.carrier_ghz);
        let view = View {
            stations: &self.stations,
            skyline: &self.skyline,
            receiver: &self.receiver,
            atmosphere: &atmosphere,
            effects: &self.effects,
            reach_m,
        };
        self.echoes.clear();
        view.standing(scene.world, &mut self.echoes);
        view.moving(&movers, &mut self.echoes);
        if self.effects.highlights {
            view.highlights(scene.world, &mut self.echoes);
        }
        if self.effects.multipath {
            view.ghosts(scene.world, &mut self.echoes);
        }
        // Always as many random numbers, so that no effect changes another's; those of bursts, which vary, come last.
        let jitter_rad = if self.effects.encoder_wobble {
            ENCODER_JITTER_RAD
        } else {
            0.0
        };
        self.jitter_rad
            .iter_mut()
            .for_each(|jitter| *jitter = jitter_rad * rng.sample::<f64, _>(StandardNormal));
        let clutter =
            |range_m: f64| atmosphere.clutter_m2(range_m, view.receiver) * view.received(range_m);
        let (snow, interference) = (weather.snow_mm_h > 0.0, self.effects.interference);
        self.noise.feel_surroundings(&self.stations, rng);
        self.noise.begin_sweep(
            &self.sampling,
            &self.spectrum,
            interference,
            snow,
            clutter,
            rng,
        );
        let middle = *self.stations.middle();
        let heard = |echo: &Echo| {
            (
                echo.azimuth,
                (echo.position - middle.position).norm(),
                echo.amplitude * echo.amplitude,
            )
        };
        self.noise.listen_around(self.echoes.iter().map(heard));
        self.beams.sort(&self.echoes, &self.antenna, &self.stations);
    }

    /// Fills the spectrum with what one azimuth receives.
    fn measure(&mut self, azimuth: usize, rng: &mut ChaCha8Rng) {
        let station = *self.stations.at(azimuth as f64);
        let doppler_s = if self.effects.doppler {
            self.doppler_s(azimuth)
        } else {
            0.0
        };
        let wavelength_m = self.receiver.wavelength_m();
        self.spectrum.clear();
        self.noise.begin_azimuth(|range_m| {
            if !self.effects.ground {
                return 0.0;
            }
            let passed = if self.effects.occlusion {
                self.skyline.open(azimuth, range_m)
            } else {
                1.0
            };
            f64::from(passed)
                * ground::ground_power(
                    station.position + station.beam * range_m,
                    range_m,
                    &self.receiver,
                )
        });
        for &number in self.beams.echoes(azimuth) {
            let echo = &self.echoes[number as usize];
            let way = echo.place(&station) - station.position;
            let range_m = way.norm();
            // Small angles: the tangent will do.
            let off_rad =
                station.beam.perp(&way) / station.beam.dot(&way) + self.jitter_rad[azimuth];
            let amplitude = echo.amplitude * self.antenna.gain(off_rad);
            let approach_mps = (station.velocity - echo.velocity).dot(&way) / range_m;
            // What approaches reads too near with a rising chirp.
            let measured_m = range_m - doppler_s * approach_mps;
            let bin = self.sampling.bin(measured_m);
            if self.effects.speckle {
                // There and back: two wavelengths of phase for each wavelength of range.
                let (sine, cosine) = (TAU * (2.0 * range_m / wavelength_m).fract()).sin_cos();
                self.spectrum
                    .add(bin, (amplitude * cosine) as f32, (amplitude * sine) as f32);
            } else {
                self.spectrum.add_power(bin, (amplitude * amplitude) as f32);
            }
            self.noise.note(measured_m, amplitude * amplitude);
        }
        self.carrier.add(&mut self.spectrum, azimuth);
        self.noise.add(&mut self.spectrum, azimuth, rng);
    }

    fn doppler_s(&self, azimuth: usize) -> f64 {
        match self.sampling.chirp {
            Chirp::Rising => self.sampling.doppler_s,
            Chirp::Falling => -self.sampling.doppler_s,
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

    /// Replaces some azimuths by the mean of their neighbours, and says so where the format can.
    fn drop_azimuths(&self, rng: &mut ChaCha8Rng, slot: &mut ScanSlot<'_>) {
        let stride = self.sampling.stride();
        rng.set_word_pos(WORDS_AN_AZIMUTH / 2);
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
