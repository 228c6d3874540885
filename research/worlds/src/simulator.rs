//! Rendering of single scans in memory, without files.

use std::{path::PathBuf, sync::Arc};

use gyre_geometry::{Pose, samples::{Sample, SampleKind}, OwnedScan, ScanLimits, ScanSlot, SweepGeometry};
use gyre_simulator::beside::{self, Kind, Record};
use nalgebra::Point2;

use crate::{config::{MAX_SCANS, SimulationConfig}, error::SimulatorError, gyro::{self, Vehicle}, path::{Path, recorded::{self, Excerpt}}, profile::Sampling, relief::Relief, sensor::{effects::is_on, PitchRoll, Scene, Sensor, SweepTime}, streets::Streets, town::{ParkedCar, Town}, traffic::{Observer, RoadUser, Traffic}, tunnel, weather::WeatherConfig, world::World, gnss, wheels};

/// Stamp of the first azimuth of the first scan, microseconds since 1970 (2019-01-10 15:00 UTC).
/// Readers check that the year is plausible, and it is fixed so that a configuration always gives
/// the same files.
const EPOCH_US: i64 = 1_547_132_400_000_000;

/// Time between the places of a drive that are checked to lie on the town's streets, seconds.
const CHECK_S: f64 = 0.5;
/// Distance within which road users are reported, metres: a third more than where radars of this
/// kind resolve a car.
const REPORTED_M: f64 = 100.0;
/// Number of scans of an endless drive, if none is given.
const ENDLESS_SCANS: usize = 64;
/// Duration of an endless drive along which streets are laid, seconds; its traffic is made for
/// multiples of this.
const ENDLESS_S: f64 = 600.0;

/// A drive through a town, ready to be rendered. Cheap to clone and shared between threads.
#[derive(Clone)]
pub struct Simulator {
    config: SimulationConfig,
    scans: usize,
    sampling: Sampling,
    path: Arc<dyn Path>,
    world: Arc<World>,
    parked: Arc<[ParkedCar]>,
    traffic: Traffic,
}

/// A scan with its ground truth.
#[derive(Clone, Debug)]
pub struct SimulatedScan {
    /// The scan, in the layout of an Oxford image (its bytes are the image's, metadata included).
    pub scan: OwnedScan,
    /// Pose of the sensor in the world at the middle of the sweep (the scan's stamp).
    pub pose: Pose,
}

impl Simulator {
    /// Builds the town and the path.
    ///
    /// # Errors
    /// As [`SimulationConfig::validate`] and [`crate::drive::DriveConfig::path`];
    /// [`SimulatorError::Config`] if the drive ends before a tunnel;
    /// [`SimulatorError::TooManyScans`] if the drive has fewer scans than are wanted,
    /// [`SimulatorError::OffStreets`] if it leaves the town's streets.
    pub fn new(config: &SimulationConfig) -> Result<Self, SimulatorError> {
        config.validate()?;
        let config = &config.resolved();
        let world = match config.town.streets.first() {
            Some(file) => Some(recorded::first_pose(file)?),
            None => None,
        };
        let path: Arc<dyn Path> = config.drive.path(config.town_seed(), world)?.into();
        let sampling = config.sensor.sampling();
        let period_s = sampling.period_us as f64 * 1e-6;
        let scans = scans(config.scans, path.duration_s(), period_s)?;
        // Streets, town and traffic do not depend on the number of scans.
        let scans_s = scans as f64 * period_s;
        let [streets_s, traffic_s] = match path.duration_s() {
            duration_s if duration_s.is_finite() => [duration_s; 2],
            _ => [ENDLESS_S, (scans_s / ENDLESS_S).ceil() * ENDLESS_S],
        };
        let streets = match world {
            Some(world) => shared_streets(config, world, (path.as_ref(), streets_s))?,
            None => {
                let (side, seed) = (config.drive.keep, config.town_seed());
                Streets::along(path.as_ref(), streets_s, side, seed)
            }
        };
        let relief = match is_on(config.effects.hills) {
            true => Relief::hills(config.town_seed()),
            false => Relief::LEVEL,
        };
        let (seed, keep) = (config.town_seed(), config.drive.keep);
        let mut town = Town::new(&config.town, &streets, seed);
        tunnel::build(
            &config.tunnels,
            &mut town.content,
            path.as_ref(),
            keep,
            seed,
        )?;
        Ok(Self {
            config: config.clone(),
            scans,
            sampling,
            world: Arc::new(World::new(town.content).on(relief)),
            parked: town.parked.into(),
            traffic: Traffic::new(
                &config.traffic,
                path.clone(),
                traffic_s,
                &streets,
                config.drive.keep,
                config.traffic_seed(),
            ),
            path,
        })
    }

    /// The configuration, with all that its realism decides written out.
    pub fn config(&self) -> &SimulationConfig {
        &self.config
    }

    /// The sampling of the radar.
    pub fn sampling(&self) -> &Sampling {
        &self.sampling
    }

    /// Scans in the dataset; scans beyond can be rendered too.
    pub fn scans(&self) -> usize {
        self.scans
    }

    /// The path of the sensor.
    pub fn path(&self) -> &dyn Path {
        self.path.as_ref()
    }

    /// The town.
    pub fn world(&self) -> &World {
        &self.world
    }

    /// The time of scan `index`.
    pub fn time(&self, index: usize) -> SweepTime {
        let Sampling {
            period_us,
            azimuths,
            ..
        } = self.sampling;
        SweepTime {
            start_us: EPOCH_US + period_us * index as i64,
            period_us,
            azimuths,
            epoch_us: EPOCH_US,
        }
    }

    /// Pose of the sensor in the world at the middle of scan `index`.
    pub fn pose(&self, index: usize) -> Pose {
        let time = self.time(index);
        self.path.pose(time.drive_time_s(time.middle_us()))
    }

    /// The other road users within 100 m at the middle of scan `index`, with what the
    /// radar can see of them.
    pub fn road_users(&self, index: usize) -> Vec<RoadUser> {
        self.road_users_at(index, self.time(index).middle_us() * 1000)
    }

    /// As [`Simulator::road_users`], at a time near the scan's.
    pub(crate) fn road_users_at(&self, index: usize, stamp_ns: i64) -> Vec<RoadUser> {
        let time_s = (stamp_ns - self.time(index).epoch_us * 1000) as f64 * 1e-9;
        let place = Point2::from(self.path.pose(time_s).translation.vector);
        let observer = Observer {
            world: &self.world,
            place,
            receiver: &self.config.sensor.receiver(),
        };
        self.traffic.road_users(time_s, REPORTED_M, &observer)
    }

    /// The parked cars of the town, those in tunnels too.
    pub fn parked_cars(&self) -> &[ParkedCar] {
        &self.parked
    }

    /// Returns the strongest echo of a parked car as scan `index` shows it, counts of half a
    /// decibel, in clear weather and without scintillation and speckle. A car of another drive
    /// through the same town is seen as if it stood here.
    pub fn parked_counts(&self, car: &ParkedCar, index: usize) -> f64 {
        let observer = Observer {
            world: &self.world,
            place: Point2::from(self.pose(index).translation.vector),
            receiver: &self.config.sensor.receiver(),
        };
        let is_here = |it: &ParkedCar| it.number == car.number && it.pose == car.pose;
        observer.parked_counts(car, self.parked.iter().any(is_here))
    }

    /// The samples of a sensor beside the radar, by their stamps, as its log has them. `None` if
    /// the drive has no such sensor.
    pub fn samples(&self, kind: SampleKind) -> Option<Vec<Sample>> {
        beside::samples(kind, |row| self.records(row))
    }

    /// The rows of the log of a sensor beside the radar.
    pub(crate) fn records(&self, kind: &Kind) -> Option<Vec<Record>> {
        let (config, path) = (&self.config, self.path());
        let device = match kind.of {
            SampleKind::Gyro => {
                let nods = config.effects.elevation;
                let pitch_roll = nods.then(|| PitchRoll::new(config.sensor_seed()));
                let vehicle = Vehicle::new(path, self.world.relief(), pitch_roll);
                gyro::device(&config.gyro, config.gyro_seed(), vehicle)
            }
            SampleKind::Wheels => wheels::device(&config.wheels, config.wheels_seed(), path),
            SampleKind::Gnss => {
                gnss::device(&config.gnss, &config.tunnels, config.gnss_seed(), path)
            }
            SampleKind::Heading => None,
        };
        Some(device?.records(self.span()))
    }

    /// The start of the drive, ns since 1970, and its duration, s.
    pub(crate) fn span(&self) -> (i64, f64) {
        let end_s = self.scans as f64 * self.sampling.period_us as f64 * 1e-6;
        (EPOCH_US * 1000, end_s)
    }

    /// A new sensor for [`Simulator::render_into`].
    pub fn sensor(&self) -> Sensor {
        let Self { config, .. } = self;
        Sensor::new(&config.sensor, &config.effects, config.sensor_seed())
    }

    /// The size of one scan.
    pub fn limits(&self) -> ScanLimits {
        ScanLimits {
            bytes: self.sampling.azimuths * self.sampling.stride(),
            azimuths: self.sampling.azimuths,
        }
    }

    /// Renders scan `index`: the same bytes whenever and on whatever thread it is called.
    pub fn render_scan(&self, index: usize) -> SimulatedScan {
        let mut scan = OwnedScan::with_limits(self.limits());
        scan.geometry = self.render_into(index, &mut self.sensor(), &mut scan.slot());
        SimulatedScan {
            scan,
            pose: self.pose(index),
        }
    }

    /// Renders scan `index` into existing memory, of at least the size of [`Simulator::limits`].
    pub fn render_into(
        &self,
        index: usize,
        sensor: &mut Sensor,
        slot: &mut ScanSlot<'_>,
    ) -> SweepGeometry {
        let time = self.time(index);
        let scene = Scene {
            world: &self.world,
            movers: &self.traffic,
            path: self.path.as_ref(),
            weather: WeatherConfig::at(&self.config.weather, time.drive_time_s(time.start_us)),
        };
        sensor.sweep(scene, time, index as u64, slot)
    }
}

/// The number of scans of a drive: those of which at least the first half is driven before its end.
///
/// # Errors
/// [`SimulatorError::TooManyScans`] if more are wanted.
fn scans(wanted: Option<usize>, duration_s: f64, period_s: f64) -> Result<usize, SimulatorError> {
    if duration_s.is_infinite() {
        return Ok(wanted.unwrap_or(ENDLESS_SCANS));
    }
    let most = (duration_s / period_s + 0.5) as usize;
    match wanted {
        Some(scans) if scans > most => Err(SimulatorError::TooManyScans {
            scans,
            most,
            duration_s,
        }),
        Some(scans) => Ok(scans),
        None => Ok(most.clamp(1, MAX_SCANS)),
    }
}

/// Lays the streets of `town.streets` in the frame `world` of their files, and checks that the
/// drive, a path and how many seconds of it, stays on them.
fn shared_streets(
    config: &SimulationConfig,
    world: Pose,
    drive: (&dyn Path, f64),
) -> Result<Streets, SimulatorError> {
    let excerpt = Excerpt {
        rate_hz: config.drive.rate_hz,
        ..Excerpt::default()
    };
    let read = |file: &PathBuf| recorded::read_in(file, excerpt, Some(world));
    let paths = config.town.streets.iter().map(read);
    let paths = paths.collect::<Result<Vec<_>, SimulatorError>>()?;
    let all: Vec<_> = paths
        .iter()
        .map(|path| (path as &dyn Path, f64::INFINITY))
        .collect();
    let streets = Streets::along_all(&all, config.drive.keep, config.town_seed());
    let (path, duration_s) = drive;
    let times = (0..=(duration_s / CHECK_S) as usize).map(|step| step as f64 * CHECK_S);
    let is_off = |at_s: &f64| {
        let place = Point2::from(path.pose(*at_s).translation.vector);
        streets.clearance_m(place, 1.0) >= 0.0
    };
    match times.into_iter().find(is_off) {
        Some(at_s) => Err(SimulatorError::OffStreets { at_s }),
        None => Ok(streets),
    }
}

#[cfg(test)]
mod tests;
