//! Rendering of single scans in memory, without files.

use std::sync::Arc;

use gyre_geometry::Pose;
use gyre_radar::{OwnedScan, ScanLimits, ScanSlot, SweepGeometry};

use crate::config::SimulationConfig;
use crate::error::SimulatorError;
use crate::path::Path;
use crate::profile::Sampling;
use crate::sensor::{Scene, Sensor, SweepTime};
use crate::streets::Streets;
use crate::town;
use crate::traffic::Traffic;
use crate::weather::WeatherConfig;
use crate::world::World;

/// Stamp of the first azimuth of the first scan, microseconds since 1970 (2019-01-10 15:00 UTC). Readers
/// check that the year is plausible, and it is fixed so that a configuration always gives the same files.
const EPOCH_US: i64 = 1_547_132_400_000_000;

/// Duration of an endless drive along which streets are laid, seconds; its traffic is made for multiples of
/// this.
const ENDLESS_S: f64 = 600.0;

/// A drive through a town, ready to be rendered. Cheap to clone and shared between threads.
#[derive(Clone)]
pub struct Simulator {
    config: SimulationConfig,
    sampling: Sampling,
    path: Arc<dyn Path>,
    world: Arc<World>,
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
    /// As [`SimulationConfig::validate`] and [`crate::drive::DriveConfig::path`].
    pub fn new(config: &SimulationConfig) -> Result<Self, SimulatorError> {
        config.validate()?;
        let path: Arc<dyn Path> = config.drive.path(config.seed)?.into();
        let sampling = config.sensor.sampling();
        // Streets, town and traffic do not depend on the number of scans.
        let scans_s = config.scans as f64 * sampling.period_us as f64 * 1e-6;
        let [streets_s, traffic_s] = match path.duration_s() {
            duration_s if duration_s.is_finite() => [duration_s; 2],
            _ => [ENDLESS_S, (scans_s / ENDLESS_S).ceil() * ENDLESS_S],
        };
        let driving_side = config.drive.keep;
        let streets = Streets::along(path.as_ref(), streets_s, driving_side, config.seed);
        Ok(Self {
            config: config.clone(),
            sampling,
            world: Arc::new(World::new(town::build(&config.town, &streets, config.seed))),
            traffic: Traffic::new(
                &config.traffic,
                path.clone(),
                traffic_s,
                &streets,
                driving_side,
                config.seed,
            ),
            path,
        })
    }

    /// The configuration.
    pub fn config(&self) -> &SimulationConfig {
        &self.config
    }

    /// The sampling of the radar.
    pub fn sampling(&self) -> &Sampling {
        &self.sampling
    }

    /// Scans in the dataset; scans beyond can be rendered too.
    pub fn scans(&self) -> usize {
        self.config.scans
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

    /// A new sensor for [`Simulator::render_into`].
    pub fn sensor(&self) -> Sensor {
        Sensor::new(&self.config.sensor, &self.config.effects, self.config.seed)
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
