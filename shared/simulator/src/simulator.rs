//! One scan at a time, from memory to memory: the simulator without files.

use std::sync::Arc;

use gyre_radar::{OwnedScan, ScanLimits, ScanSlot, SweepGeometry};
use nalgebra::Isometry2;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

use crate::profile::{Chirp, Profile, Sampling};
use crate::sensor::{self, Sensor, SweepTime};
use crate::streets::Streets;
use crate::traffic::Traffic;
use crate::trajectory::Trajectory;
use crate::world::World;
use crate::{SimulationConfig, SimulatorError, town};

/// Stamp of the first azimuth of the first scan, microseconds since 1970 (2019-01-10 15:00 UTC): readers
/// of recordings check that a year is plausible, and the same configuration has to give the same files.
const EPOCH_US: i64 = 1_547_132_400_000_000;

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
        // Not as far as the scans go: more of them must find the same town.
        let streets = Streets::driven(trajectory.as_ref(), trajectory.duration_s().min(100.0), 0.0);
        Ok(Self {
            scans: config.scans,
            seed: config.seed,
            period_us: (config.sensor.period_s * 1e6).round() as i64,
            doppler_shift_s: config.sensor.doppler_shift_s,
            world: Arc::new(World::new(town::build(&config.drive, &streets, config.seed))),
            traffic: Traffic::new(&config.traffic, trajectory.clone(), config.seed),
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

    /// What memory a scan needs.
    pub fn limits(&self) -> ScanLimits {
        let Sampling { azimuths, bins, .. } = self.sampling();
        ScanLimits { bytes: azimuths * (sensor::METADATA_BYTES + bins), azimuths }
    }

    /// How the radar samples what it sees.
    pub fn sampling(&self) -> Sampling {
        let (period_us, doppler_s) = (self.period_us, self.doppler_shift_s);
        // What approaches is measured too far.
        let chirp = Chirp::Falling;
        Sampling { range_offset_m: 0.0, period_us, chirp, doppler_s, ..Profile::default().sampling() }
    }

    /// Measures scan `index`: the same bytes whenever and on whatever thread it is called.
    pub fn render_scan(&self, index: usize) -> SimulatedScan {
        let mut scan = empty_scan();
        scan.geometry = self.render_into(index, &mut self.sensor(), &mut scan.slot());
        SimulatedScan { scan, pose: self.pose(index) }
    }

    /// Measures scan `index` into memory of the caller's, at least as long as [`Simulator::limits`] say, and says how it lies there.
    pub fn render_into(&self, index: usize, sensor: &mut Sensor, slot: &mut ScanSlot<'_>) -> SweepGeometry {
        let mut rng = ChaCha8Rng::seed_from_u64(self.seed);
        // Stream 0 built the town.
        rng.set_stream(index as u64 + 1);
        let (world, trajectory) = (self.world.as_ref(), self.trajectory.as_ref());
        sensor.sweep(world, &self.traffic, trajectory, self.time(index), &mut rng, slot)
    }
}

/// A scan with room for one sweep.
pub fn empty_scan() -> OwnedScan {
    OwnedScan::with_limits(ScanLimits { bytes: sensor::AZIMUTHS * sensor::STRIDE, azimuths: sensor::AZIMUTHS })
}
