//! A sweep of a radar like Navtech's CTS350-X, each azimuth measured at its own time from its own pose.
//!
//! Echoes are summed as complex amplitudes with the phase of their true path, so that scatterers in one resolution
//! cell interfere (speckle), and do so differently from the next pose. Not modelled: elevation,
//! mirrored echoes (multipath) other than a diffuse rest, weather.

use std::f64::consts::{LN_2, TAU};

use gyre_radar::scan::flag;
use gyre_radar::{ScanSlot, Sense, SweepGeometry};
use nalgebra::{Isometry2, Point2, Vector2};
use rand::Rng;
use serde::{Deserialize, Serialize};

use crate::SimulatorError;
use crate::config::within;
use crate::occlusion;
use crate::receiver::{NOISE_OVERLAP, RangeSpectrum};
use crate::trajectory::Trajectory;
use crate::world::{Body, Movers, Scatterer, World};

/// Azimuths of a sweep.
pub const AZIMUTHS: usize = 400;
/// Range bins of an azimuth.
pub const BINS: usize = 3768;
/// Metres a range bin; the first bin's centre is at half of it.
pub const RANGE_RESOLUTION_M: f64 = 0.0438;
/// Bytes of metadata before each azimuth's bins: stamp, encoder, validity, as in Oxford's files.
pub const METADATA_BYTES: usize = 11;
/// Bytes of an azimuth.
pub const STRIDE: usize = METADATA_BYTES + BINS;
/// Counts of the encoder in one turn.
pub const ENCODER_TURN: u16 = 5600;
/// Counts from one azimuth to the next.
const ENCODER_STEP: u16 = 14;
/// Count of the first azimuth: real sweeps do not begin at zero.
const ENCODER_FIRST: u16 = 13;

/// Carrier wavelength, metres (76.5 GHz).
const WAVELENGTH_M: f64 = 299_792_458.0 / 76.5e9;
/// Width of the two-way beam at half power, radians (1.8 degrees: two azimuths).
const BEAM_RAD: f64 = 1.8 * TAU / 360.0;
/// Beyond this angle from the beam's middle nothing is received, radians: 48 dB down.
const BEAM_CUT_RAD: f64 = 2.0 * BEAM_RAD;
/// Power received from 1 m² at 1 m if there were no near field, in units of the receiver (1 is its least step).
const RADAR_CONSTANT: f64 = 1.5e10;
/// Range below which the fall-off flattens, metres: the antenna looks over what is near, the receiver filters it.
const NEAR_M: f64 = 15.0;
/// Nothing reflects nearer than this, metres: it would be inside the radar.
const NEAREST_M: f64 = 0.5;
/// Mean power of the receiver's noise.
const NOISE_POWER: f64 = 1.9;
/// Phase noise: share of an azimuth's total echo power that raises the floor in all its bins.
const SKIRT: f64 = 2.0e-6;
/// Echoes with less power than this are not worth adding.
const NEGLIGIBLE_POWER: f64 = 0.05;

/// Azimuths whose lists of visible scatterers are shared; the poses they see them from are their own.
const BLOCK: usize = 10;
/// Angle beyond a block's azimuths in which scatterers may come into their beams as the vehicle moves, radians.
const BLOCK_MARGIN_RAD: f64 = BEAM_CUT_RAD + 0.1;

/// What measures: the section `[simulation.sensor]`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct SensorConfig {
    /// Time of one sweep, seconds.
    pub period_s: f64,
    /// Seconds by which a closing speed lengthens a range: a chirp cannot tell Doppler shift from delay.
    /// 0.049 has been measured on Navtech radars (Burnett et al. 2021); 0 for a radar without the effect.
    pub doppler_shift_s: f64,
}

impl Default for SensorConfig {
    fn default() -> Self {
        Self { period_s: 0.25, doppler_shift_s: 0.049 }
    }
}

impl SensorConfig {
    /// Refuses what cannot be simulated, naming the key.
    pub fn validate(&self) -> Result<(), SimulatorError> {
        within("sensor.period_s", self.period_s, 0.05, 2.0)?;
        within("sensor.doppler_shift_s", self.doppler_shift_s, -0.5, 0.5)
    }
}

/// When a sweep happens.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SweepTime {
    /// The first azimuth's stamp, microseconds since 1970.
    pub start_us: i64,
    /// Time of one turn, microseconds.
    pub period_us: i64,
    /// The trajectory's time zero, microseconds since 1970.
    pub epoch_us: i64,
}

impl SweepTime {
    /// Stamp of an azimuth, microseconds since 1970.
    pub fn stamp_us(&self, azimuth: usize) -> i64 {
        self.start_us + self.period_us * azimuth as i64 / AZIMUTHS as i64
    }

    /// Middle of the sweep: half-way between the first and the last azimuth, microseconds since 1970.
    pub fn middle_us(&self) -> i64 {
        self.start_us + (self.stamp_us(AZIMUTHS - 1) - self.start_us) / 2
    }

    /// Time on the trajectory of a stamp, seconds.
    pub fn trajectory_s(&self, stamp_us: i64) -> f64 {
        (stamp_us - self.epoch_us) as f64 * 1e-6
    }
}

/// Encoder count at an azimuth.
pub fn encoder_count(azimuth: usize) -> u16 {
    ENCODER_FIRST + ENCODER_STEP * azimuth as u16
}

/// Angle of an azimuth, radians clockwise from straight ahead.
pub fn azimuth_rad(azimuth: usize) -> f64 {
    f64::from(encoder_count(azimuth)) * TAU / f64::from(ENCODER_TURN)
}

/// Something visible, with the amplitude that its size, aspect and cover leave.
#[derive(Clone, Copy, Debug)]
struct Echo {
    position: Point2<f64>,
    amplitude: f64,
}

/// The radar, with its working memory.
#[derive(Clone, Debug)]
pub struct Sensor {
    /// Metres of range that a closing speed of 1 m/s adds.
    doppler_shift_s: f64,
    spectrum: RangeSpectrum,
    /// Mean power of noise, ringing and diffuse echoes in each noise cell.
    background: Vec<f64>,
    echoes: Vec<Echo>,
}

impl Sensor {
    /// A radar that has seen nothing yet. See [`crate::SimulationConfig::doppler_shift_s`].
    pub fn new(doppler_shift_s: f64) -> Self {
        let spectrum = RangeSpectrum::new(BINS);
        let (cells, spacing) = spectrum.noise_cells();
        let range_m = |cell: usize| (cell as f64 * spacing + 0.5) * RANGE_RESOLUTION_M;
        let background = (0..cells).map(|cell| background_power(range_m(cell))).collect();
        Self { doppler_shift_s, spectrum, background, echoes: Vec::new() }
    }

    /// Measures one sweep into `slot` (whose `bytes` take [`AZIMUTHS`] rows of [`STRIDE`]) and says how it lies there.
    ///
    /// The bytes are those of an Oxford image, metadata included. All randomness comes from `rng`.
    pub fn sweep(
        &mut self,
        world: &World,
        movers: &dyn Movers,
        trajectory: &dyn Trajectory,
        time: SweepTime,
        rng: &mut impl Rng,
        slot: &mut ScanSlot<'_>,
    ) -> SweepGeometry {
        for first in (0..AZIMUTHS).step_by(BLOCK) {
            let middle_s = time.trajectory_s(time.stamp_us(first + BLOCK / 2));
            let pose = trajectory.pose(middle_s);
            let mut moving = Body::default();
            movers.visit(middle_s, Point2::from(pose.translation.vector), BINS as f64 * RANGE_RESOLUTION_M, &mut |m| {
                moving.scatterers.extend(m.body.scatterers.iter().map(|s| s.moved(&m.pose)));
                moving.walls.extend(m.body.walls.iter().map(|w| w.moved(&m.pose)));
            });
            self.illuminate(world, &moving, &pose, first);
            for azimuth in first..first + BLOCK {
                let stamp_us = time.stamp_us(azimuth);
                let (pose, velocity) = motion_at(trajectory, time.trajectory_s(stamp_us));
                self.measure(&pose, velocity, azimuth, rng);
                let row = &mut slot.bytes[azimuth * STRIDE..(azimuth + 1) * STRIDE];
                write_metadata(&mut row[..METADATA_BYTES], stamp_us, encoder_count(azimuth));
                self.spectrum.read_out(&mut row[METADATA_BYTES..]);
                slot.azimuth_rad[azimuth] = azimuth_rad(azimuth) as f32;
                slot.stamp_ns[azimuth] = stamp_us * 1000;
                slot.flags[azimuth] = flag::MEASURED;
            }
        }
        geometry(time)
    }

    /// Lists what can be seen around the block of azimuths that begins at `first`.
    fn illuminate(&mut self, world: &World, movers: &Body, pose: &Isometry2<f64>, first: usize) {
        let middle = azimuth_rad(first) + TAU / AZIMUTHS as f64 * (BLOCK as f64 - 1.0) / 2.0;
        let direction = beam_direction(pose, middle);
        let half_angle = TAU / AZIMUTHS as f64 * BLOCK as f64 / 2.0 + BLOCK_MARGIN_RAD;
        let from = Point2::from(pose.translation.vector);
        self.echoes.clear();
        for scatterer in world.scatterers().iter().chain(&movers.scatterers) {
            let way = scatterer.position - from;
            // The cosine of the angle between the two is enough to tell, without a root.
            let ahead = way.dot(&direction);
            if ahead > 0.0 && ahead * ahead > way.norm_squared() * half_angle.cos().powi(2) {
                self.echoes.extend(echo(scatterer, world, movers, from));
            }
        }
    }

    /// Fills the spectrum with what one azimuth receives.
    fn measure(&mut self, pose: &Isometry2<f64>, velocity: Vector2<f64>, azimuth: usize, rng: &mut impl Rng) {
        let direction = beam_direction(pose, azimuth_rad(azimuth));
        let from = Point2::from(pose.translation.vector);
        self.spectrum.clear();
        let mut total = 0.0;
        for echo in &self.echoes {
            let way = echo.position - from;
            let off_beam = direction.perp(&way) / way.dot(&direction);
            if off_beam.abs() > BEAM_CUT_RAD {
                continue;
            }
            let range_m = way.norm();
            let beam = (-2.0 * LN_2 * (off_beam / BEAM_RAD).powi(2)).exp();
            let amplitude = echo.amplitude * beam * fall_off(range_m).sqrt();
            // There and back: two wavelengths of phase for each wavelength of range.
            let phase = TAU * (2.0 * range_m / WAVELENGTH_M).fract();
            let measured_m = range_m + self.doppler_shift_s * velocity.dot(&way) / range_m;
            let bin = measured_m / RANGE_RESOLUTION_M - 0.5;
            self.spectrum.add(bin, (amplitude * phase.cos()) as f32, (amplitude * phase.sin()) as f32);
            total += amplitude * amplitude;
        }
        self.add_noise(SKIRT * total, rng);
    }

    /// Adds complex Gaussian noise: exponentially distributed power, `raised` above the background everywhere.
    fn add_noise(&mut self, raised: f64, rng: &mut impl Rng) {
        let (_, spacing) = self.spectrum.noise_cells();
        for (cell, background) in self.background.iter().enumerate() {
            let mean = (background + raised) as f32 / NOISE_OVERLAP;
            let amplitude = (-mean * (1.0 - rng.random::<f32>()).ln()).sqrt();
            let (sine, cosine) = (std::f32::consts::TAU * rng.random::<f32>()).sin_cos();
            self.spectrum.add(cell as f64 * spacing, amplitude * cosine, amplitude * sine);
        }
    }
}

/// Pose and velocity (metres a second, world frame) at a time.
fn motion_at(trajectory: &dyn Trajectory, time_s: f64) -> (Isometry2<f64>, Vector2<f64>) {
    let half_s = 0.5e-3;
    let (before, after) = (trajectory.pose(time_s - half_s), trajectory.pose(time_s + half_s));
    let velocity = (after.translation.vector - before.translation.vector) / (2.0 * half_s);
    (trajectory.pose(time_s), velocity)
}

/// Unit vector along an azimuth, world frame: azimuths grow clockwise, angles counter-clockwise.
fn beam_direction(pose: &Isometry2<f64>, azimuth_rad: f64) -> Vector2<f64> {
    pose * Vector2::new(azimuth_rad.cos(), -azimuth_rad.sin())
}

/// The radar equation: received power from 1 m² at a range, the fourth power of range tamed near by.
fn fall_off(range_m: f64) -> f64 {
    RADAR_CONSTANT / (range_m * range_m + NEAR_M * NEAR_M).powi(2)
}

/// What a scatterer sends back to `from`, if it is worth counting.
fn echo(scatterer: &Scatterer, world: &World, movers: &Body, from: Point2<f64>) -> Option<Echo> {
    let way = from - scatterer.position;
    let range_m = way.norm();
    if !(NEAREST_M..BINS as f64 * RANGE_RESOLUTION_M).contains(&range_m) {
        return None;
    }
    let in_the_open = scatterer.cross_section_m2 * scatterer.aspect.gain(way / range_m);
    let received = in_the_open * fall_off(range_m);
    if received <= NEGLIGIBLE_POWER {
        return None;
    }
    let negligible = NEGLIGIBLE_POWER / received;
    let mut passed = world.transmission(from, scatterer.position, scatterer.body, negligible);
    for wall in movers.walls.iter().filter(|wall| wall.body != scatterer.body) {
        if occlusion::crossing(from, -way, wall).is_some() {
            passed *= wall.transmission;
        }
    }
    (passed > negligible).then(|| Echo { position: scatterer.position, amplitude: (in_the_open * passed).sqrt() })
}

/// Mean power without any echo at a range, fitted by eye to real scans of a town:
/// the receiver's noise, the transmitter's ringing (the first two metres), and the diffuse
/// rest of ground and many-fold reflections that dies out along the street.
fn background_power(range_m: f64) -> f64 {
    let ringing = 180.0 * (-((range_m - 0.7) / 0.6).powi(2)).exp() + 12.0 * (-range_m / 0.8).exp();
    let diffuse = 3.0 * (-range_m / 45.0).exp() * (1.0 - (-(range_m / 8.0).powi(2)).exp());
    NOISE_POWER + ringing + diffuse
}

/// Oxford's eleven bytes: stamp (i64, microseconds), encoder count (u16), 255 for measured; little-endian.
fn write_metadata(bytes: &mut [u8], stamp_us: i64, encoder: u16) {
    bytes[..8].copy_from_slice(&stamp_us.to_le_bytes());
    bytes[8..10].copy_from_slice(&encoder.to_le_bytes());
    bytes[10] = 255;
}

fn geometry(time: SweepTime) -> SweepGeometry {
    SweepGeometry {
        azimuths: AZIMUTHS,
        bins: BINS,
        stride: STRIDE,
        first_byte: METADATA_BYTES,
        range_resolution_m: RANGE_RESOLUTION_M as f32,
        range_offset_m: 0.0,
        doppler_s: 0.0,
        sense: Sense::Clockwise,
        stamp_ns: (time.start_us + time.stamp_us(AZIMUTHS - 1)) * 500,
    }
}
