//! One scan at a time, from memory to memory: the simulator without files.

use gyre_radar::{OwnedScan, ScanLimits};
use nalgebra::Isometry2;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

use crate::path::{BlockLoop, Trajectory};
use crate::sensor::{self, Sensor, SweepTime};
use crate::traffic::Traffic;
use crate::world::World;
use crate::{SimulationConfig, SimulatorError, town};

/// Stamp of the first azimuth of the first scan, microseconds since 1970 (2019-01-10 15:00 UTC): readers
/// of recordings check that a year is plausible, and the same configuration has to give the same files.
const EPOCH_US: i64 = 1_547_132_400_000_000;

/// A drive through a town, ready to be measured. Shared freely between threads.
#[derive(Clone, Debug)]
pub struct Simulator {
    scans: usize,
    seed: u64,
    period_us: i64,
    doppler_shift_s: f64,
    path: BlockLoop,
    world: World,
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
        let path = BlockLoop::new(
            config.block_length_m,
            config.block_width_m,
            config.speed_m_s,
            config.lateral_acceleration_m_s2,
        );
        Ok(Self {
            scans: config.scans,
            seed: config.seed,
            period_us: (config.period_s * 1e6).round() as i64,
            doppler_shift_s: config.doppler_shift_s,
            world: town::build(config, &path),
            traffic: Traffic::new(config.traffic, config.seed),
            path,
        })
    }

    /// Scans in the dataset; more can be rendered.
    pub fn scans(&self) -> usize {
        self.scans
    }

    /// The drive.
    pub fn path(&self) -> &BlockLoop {
        &self.path
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
        self.path.pose(time.trajectory_s(time.middle_us()))
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
        // Stream 0 built the town.
        rng.set_stream(index as u64 + 1);
        let movers = |time_s: f64| self.traffic.at(&self.path, time_s);
        scan.geometry = sensor.sweep(&self.world, &movers, &self.path, self.time(index), &mut rng, &mut scan.slot());
    }
}

/// A scan with room for one sweep.
pub fn empty_scan() -> OwnedScan {
    OwnedScan::with_limits(ScanLimits { bytes: sensor::AZIMUTHS * sensor::STRIDE, azimuths: sensor::AZIMUTHS })
}
