//! A sweep of a spinning FMCW radar, each azimuth measured at its own time from its own pose.
//!
//! In the order of a measurement:
//!
//! - `sweep_poses`: the sensor's pose at each azimuth, and the times at which its beam passes a
//!   place,
//! - `line_of_sight`: rays in all directions, and the walls along each,
//! - `echoes`, `highlights`, `ghosts`: direct echoes, specular reflections of walls, and mirror
//!   images, with their amplitudes; `atmosphere`: attenuation by the weather,
//! - `scintillation`: fluctuation of echoes with the direction; `foliage`: from scan to scan,
//! - `one_bounce`: paths with one bounce off a wall; `faults`: dirt, vibration, miscalibration,
//! - `elevation`, `antenna`: the beam's pattern in elevation and azimuth,
//! - `spectrum`: range processing and quantisation,
//! - `ground`: backscatter of road and fields,
//! - `fixed_echoes`: ringing and the vehicle's own parts; `noise`: all power that is no single
//!   echo,
//! - `effects`: switches for all of these.
//!
//! Echoes are summed as complex amplitudes with the phase of their true path, so scatterers in one
//! resolution cell interfere (speckle), differently from each pose. Not modelled: what hills hide,
//! and the shape of objects over their height.

mod antenna;
mod atmosphere;
mod beam_index;
mod config;
mod echoes;
pub mod effects;
mod elevation;
mod faults;
mod fixed_echoes;
mod foliage;
mod ghosts;
mod ground;
mod highlights;
mod line_of_sight;
mod miscalibration;
mod noise;
mod one_bounce;
mod radome;
mod scintillation;
pub mod spectrum;
mod sweep_poses;
mod vibration;

use std::f64::consts::TAU;

use gyre_geometry::{scan::flag, ScanSlot, Sense, SweepGeometry};
use rand::Rng;
use rand_chacha::ChaCha8Rng;
use rand_distr::StandardNormal;

use self::{antenna::Antenna, atmosphere::Atmosphere, beam_index::BeamIndex};
pub use self::config::SensorConfig;
use self::echoes::{Echo, View};
pub use self::effects::Effects;
use self::effects::is_on;
pub(crate) use self::elevation::PitchRoll;
use crate::{body::{Movers, Moving}, path::Path, profile::{Chirp, METADATA_BYTES, Receiver, Sampling}, relief::Relief, stream::Stream, weather::WeatherConfig, world::World};
use self::{faults::Faults, fixed_echoes::FixedEchoes, line_of_sight::LineOfSight, noise::Noise, spectrum::RangeSpectrum, sweep_poses::SweepPoses};
pub use gyre_simulator::SweepTime;

/// Size of each azimuth's part of a scan's random numbers, in words.
const WORDS_PER_AZIMUTH: u128 = 1 << 24;
/// Share of azimuths that are lost.
const DROPPED: f64 = 0.002;
/// Jitter of the encoder, standard deviation, radians: a third of a count.
const ENCODER_JITTER_RAD: f64 = 3.7e-4;

/// The surroundings of the sensor during a sweep.
#[derive(Clone, Copy)]
pub struct Scene<'a> {
    /// The static world.
    pub world: &'a World,
    /// The moving bodies.
    pub movers: &'a dyn Movers,
    /// The path of the sensor.
    pub path: &'a dyn Path,
    /// The weather.
    pub weather: WeatherConfig,
}

/// A radar with its working memory.
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
    fixed_echoes: FixedEchoes,
    pitch_roll: PitchRoll,
    faults: Faults,
    sweep_poses: SweepPoses,
    line_of_sight: LineOfSight,
    echoes: Vec<Echo>,
    beams: BeamIndex,
    jitter_rad: Vec<f64>,
}

impl Sensor {
    /// A new radar; all its randomness comes from `seed`.
    pub fn new(config: &SensorConfig, effects: &Effects, seed: u64) -> Self {
        let (sampling, receiver) = (config.sampling(), config.receiver());
        let spectrum = RangeSpectrum::new(sampling.bins, sampling.range_resolution_m, &receiver);
        Self {
            antenna: Antenna::new(receiver.beam_rad, effects.side_lobes),
            noise: Noise::new(&sampling, &receiver, effects, &spectrum),
            fixed_echoes: FixedEchoes::new(&sampling, &receiver, effects, &spectrum, seed),
            pitch_roll: PitchRoll::new(seed),
            faults: Faults::new(effects, seed),
            spectrum,
            seed,
            sweep_poses: SweepPoses::default(),
            line_of_sight: LineOfSight::default(),
            echoes: Vec::new(),
            beams: BeamIndex::default(),
            jitter_rad: vec![0.0; sampling.azimuths],
            config: config.clone(),
            effects: *effects,
            sampling,
            receiver,
        }
    }

    /// The sampling of the radar.
    pub fn sampling(&self) -> &Sampling {
        &self.sampling
    }

    /// Measures one sweep into `slot` and returns its geometry: rows of [`METADATA_BYTES`], then
    /// powers, as in an Oxford image.
    ///
    /// All randomness comes from the radar's seed and `index`, the number of the scan.
    pub fn sweep(
        &mut self,
        scene: Scene<'_>,
        time: SweepTime,
        index: u64,
        slot: &mut ScanSlot<'_>,
    ) -> SweepGeometry {
        let mut rng = Stream::Scan(index).generator(self.seed);
        self.collect_echoes(scene, time, index, &mut rng);
        let relief = scene.world.relief();
        for azimuth in 0..self.sampling.azimuths {
            rng.set_word_pos((azimuth as u128 + 1) * WORDS_PER_AZIMUTH);
            self.measure(azimuth, relief, &mut rng);
            self.write_row(azimuth, time, slot);
        }
        if self.effects.dropped_azimuths {
            self.drop_azimuths(&mut rng, slot);
        }
        self.geometry(time)
    }

    /// Collects the echoes of the sweep.
    fn collect_echoes(
        &mut self,
        scene: Scene<'_>,
        time: SweepTime,
        index: u64,
        rng: &mut ChaCha8Rng,
    ) {
        let eccentricity_rad = if self.effects.encoder_wobble {
            self.config.azimuth_eccentricity_rad
        } else {
            0.0
        };
        let moving = self.effects.sweep_motion;
        self.faults.begin_sweep(&self.effects, self.seed, index);
        let error_rad = |azimuth_rad: f64| {
            eccentricity_rad * azimuth_rad.cos() + self.faults.error_rad(azimuth_rad)
        };
        let elevation_rad =
            |time_s, azimuth_rad| self.pitch_roll.elevation_rad(time_s, azimuth_rad);
        self.sweep_poses.sample(
            scene.path,
            time,
            &self.sampling,
            moving,
            error_rad,
            elevation_rad,
        );
        let relief = scene.world.relief();
        self.sweep_poses
            .tilt(|place, direction| relief.slope_rad(place, direction));
        let middle_s = time.drive_time_s(time.middle_us());
        let centre = self.sweep_poses.middle().position;
        let reach_m = self.sampling.reach_m();
        let mut movers: Vec<Moving<'_>> = Vec::new();
        scene
            .movers
            .visit(middle_s, centre, reach_m, &mut |mover| movers.push(mover));
        self.line_of_sight
            .cast(scene.world, &movers, &self.sweep_poses, reach_m);
        let weather = if self.effects.weather {
            scene.weather
        } else {
            WeatherConfig::default()
        };
        let atmosphere = Atmosphere::new(&weather, self.receiver.carrier_ghz);
        let view = View {
            sweep_poses: &self.sweep_poses,
            line_of_sight: &self.line_of_sight,
            receiver: &self.receiver,
            atmosphere: &atmosphere,
            effects: &self.effects,
            relief,
            scan: index,
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
        if is_on(self.effects.one_bounce) {
            view.one_bounce(scene.world, &self.antenna, &mut self.echoes);
        }
        // The number of drawn values does not depend on the effects, so that none changes
        // another's. Interference, which needs a varying number, comes last.
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
        self.noise.draw_reverberation(&self.sweep_poses, rng);
        self.noise.begin_sweep(
            &self.sampling,
            &self.spectrum,
            interference,
            snow,
            clutter,
            rng,
        );
        let middle = *self.sweep_poses.middle();
        let power_of = |echo: &Echo| {
            (
                echo.azimuth,
                (echo.position - middle.position).norm(),
                echo.amplitude * echo.amplitude,
            )
        };
        self.noise.collect_powers(self.echoes.iter().map(power_of));
        self.beams
            .sort(&self.echoes, &self.antenna, &self.sweep_poses);
    }

    /// Computes the spectrum that one azimuth receives.
    fn measure(&mut self, azimuth: usize, relief: Relief, rng: &mut ChaCha8Rng) {
        let azimuth_pose = *self.sweep_poses.at(azimuth as f64);
        let doppler_s = if self.effects.doppler {
            self.doppler_s(azimuth)
        } else {
            0.0
        };
        let wavelength_m = self.receiver.wavelength_m();
        let through = self.faults.amplitude(self.sampling.azimuth_rad(azimuth));
        self.spectrum.clear();
        self.noise.begin_azimuth(|range_m| {
            if !self.effects.ground {
                return 0.0;
            }
            let passed = if self.effects.occlusion {
                self.line_of_sight.transmission_along(azimuth, range_m)
            } else {
                1.0
            };
            let power = ground::ground_power(&azimuth_pose, range_m, relief, &self.receiver);
            f64::from(passed) * power * through * through
        });
        for &number in self.beams.echoes(azimuth) {
            let echo = &self.echoes[number as usize];
            let ray = echo.place(&azimuth_pose) - azimuth_pose.position;
            // On the slant.
            let range_m = (ray.norm_squared() + echo.height_m.powi(2)).sqrt();
            // Small angles: the tangent is the angle.
            let off_rad = azimuth_pose.beam.perp(&ray) / azimuth_pose.beam.dot(&ray)
                + self.jitter_rad[azimuth];
            let amplitude = echo.amplitude * self.antenna.gain(off_rad) * through;
            let approach_mps = (azimuth_pose.velocity - echo.velocity).dot(&ray) / range_m;
            // With a rising chirp approaching objects are measured too near.
            let measured_m = self.faults.shown_m(range_m) - doppler_s * approach_mps;
            let bin = self.sampling.bin(measured_m);
            if self.effects.speckle {
                // Two-way: two wavelengths of phase for each wavelength of range.
                let (sine, cosine) = (TAU * (2.0 * range_m / wavelength_m).fract()).sin_cos();
                self.spectrum
                    .add(bin, (amplitude * cosine) as f32, (amplitude * sine) as f32);
            } else {
                self.spectrum.add_power(bin, (amplitude * amplitude) as f32);
            }
            self.noise.add_echo(measured_m, amplitude * amplitude);
        }
        self.fixed_echoes.add(&mut self.spectrum, azimuth);
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
