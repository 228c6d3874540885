//! One scan at a time, from memory to memory: the simulator without files.

use std::sync::Arc;

use gyre_radar::{OwnedScan, ScanLimits};
use nalgebra::Isometry2;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

use crate::sensor::{self, Sensor, SweepTime};
use crate::streets::Streets;
use crate::traffic::Traffic;
use crate::trajectory::Trajectory;
use crate::world::World;
use crate::{SimulationConfig, SimulatorError, town};

/// Stamp of the first azimuth of the first scan, microseconds since 1970 (2019-01-10 15:00 UTC): readers
/// of recordings check that a year is plausible, and the same configuration has to give the same files.
const EPOCH_US: i64 = 1_547_132_400_000_000;

/// A drive without an end has repeated itself by then, seconds.
const ENDLESS_S: f64 = 100.0;

/// A drive through a town, ready to be measured. Shared freely between threads.
#[derive(Clone)]
pub struct Simulator {
    scans: usize,
    seed: u64,
    period_us: i64,
    doppler_shift_s: f64,
    trajectory: Arc<dyn Trajectory>,
    world: Arc<World>,
    traffic: Traffic,
}

/// A scan with the truth about it.
#[derive(Clone, Debug)]
pub struct SimulatedScan {
    /// The scan, in the layout of an Oxford image (its bytes are the image's, metadata included).
    pub scan: OwnedScan,
    /// Pose of the sensor in the world at the middle of the sweep (the scan's stamp).
    pub pose: Isometry2<f64>,
}

impl Simulator {
    /// Builds the town and the drive. Fails where the configuration makes no sense.
    pub fn new(config: &SimulationConfig) -> Result<Self, SimulatorError> {
        config.validate()?;
        let trajectory: Arc<dyn Trajectory> = config.drive.trajectory(config.seed)?.into();
        // Of the whole drive, however many scans are wanted: they are to see the same town.
        let ends_s = Some(trajectory.duration_s()).filter(|duration_s| duration_s.is_finite());
        let drive_s = ends_s.unwrap_or(ENDLESS_S.max(config.scans as f64 * config.sensor.period_s));
        let keep = config.drive.keep;
        let streets = Streets::along(trajectory.as_ref(), ends_s.unwrap_or(ENDLESS_S), keep, config.seed);
        Ok(Self {
            scans: config.scans,
            seed: config.seed,
            period_us: (config.sensor.period_s * 1e6).round() as i64,
            doppler_shift_s: config.sensor.doppler_shift_s,
            world: Arc::new(World::new(town::build(&config.town, &streets, config.seed))),
            traffic: Traffic::new(&config.traffic, trajectory.clone(), drive_s, &streets, keep, config.seed),
            trajectory,
        })
    }

    /// Scans in the dataset; more can be rendered.
    pub fn scans(&self) -> usize {
        self.scans
    }

    /// The drive.
    pub fn trajectory(&self) -> &dyn Trajectory {
        self.trajectory.as_ref()
    }

    /// The town.
    pub fn world(&self) -> &World {
        &self.world
    }

    /// When scan `index` is taken.
    pub fn time(&self, index: usize) -> SweepTime {
        SweepTime { start_us: EPOCH_US + self.period_us * index as i64, period_us: self.period_us, epoch_us: EPOCH_US }
    }

    /// Pose of the sensor in the world at the middle of scan `index`.
    pub fn pose(&self, index: usize) -> Isometry2<f64> {
        let time = self.time(index);
        self.trajectory.pose(time.trajectory_s(time.middle_us()))
    }

    /// A radar as configured, for [`Simulator::render_into`].
    pub fn sensor(&self) -> Sensor {
        Sensor::new(self.doppler_shift_s)
    }

    /// Measures scan `index`: the same bytes whenever and on whatever thread it is called.
    pub fn render_scan(&self, index: usize) -> SimulatedScan {
        let mut scan = empty_scan();
        self.render_into(index, &mut self.sensor(), &mut scan);
        SimulatedScan { scan, pose: self.pose(index) }
    }

    /// Measures scan `index` into memory that is used again; see [`empty_scan`].
    pub fn render_into(&self, index: usize, sensor: &mut Sensor, scan: &mut OwnedScan) {
        let mut rng = ChaCha8Rng::seed_from_u64(self.seed);
        // A stream of its own for each scan.
        rng.set_stream(index as u64 + 1);
        let (world, trajectory) = (self.world.as_ref(), self.trajectory.as_ref());
        scan.geometry = sensor.sweep(world, &self.traffic, trajectory, self.time(index), &mut rng, &mut scan.slot());
    }
}

/// A scan with room for one sweep.
pub fn empty_scan() -> OwnedScan {
    OwnedScan::with_limits(ScanLimits { bytes: sensor::AZIMUTHS * sensor::STRIDE, azimuths: sensor::AZIMUTHS })
}
