//! Rendering of single scans in memory, without files.

use std::sync::Arc;

use gyre_geometry::{OwnedScan, Pose, ScanLimits, ScanSlot, SweepGeometry};
use nalgebra::Point2;

use crate::{
    beside::{Kind, Record},
    cars::Cars,
    config::{MAX_SCANS, Realism, SimulationConfig},
    error::SimulatorError,
    path::Path,
    profile::Sampling,
    route::Route,
    scenery,
    sensor::{Scene, Sensor, SweepTime},
    world::World,
};

/// Stamp of the first azimuth of the first scan, microseconds since 1970 (2019-01-10 15:00 UTC).
/// Readers check that the year is plausible, and it is fixed so that a configuration always gives
/// the same files.
const EPOCH_US: i64 = 1_547_132_400_000_000;

/// Number of scans of an endless drive, if the configuration has no number.
const ENDLESS_SCANS: usize = 64;
/// Distance beyond the radar's reach within which bodies move, metres.
const BEYOND_M: f64 = 10.0;

/// A drive, ready to be rendered. Cheap to clone and shared between threads.
#[derive(Clone)]
pub struct Simulator {
    config: SimulationConfig,
    scans: usize,
    sampling: Sampling,
    path: Arc<dyn Path>,
    world: Arc<World>,
    pub(crate) cars: Arc<Cars>,
}

impl Simulator {
    pub fn new(config: &SimulationConfig) -> Result<Self, SimulatorError> {
        config.validate()?;
        let sampling = config.sensor.sampling();
        let period_s = sampling.period_us as f64 * 1e-6;
        let path: Arc<dyn Path> = config.drive.path(1.0 / period_s)?.into();
        let scans = scans(config.scans, path.duration_s(), period_s)?;
        let route = Route::along(path.as_ref());
        let mut scenery = scenery::build(&route, config.seed);
        if let Some(tunnel_m) = config.tunnel_m {
            scenery::build_tunnel(tunnel_m, &mut scenery, &route, config.seed)?;
        }
        Ok(Self {
            config: config.clone(),
            scans,
            sampling,
            world: Arc::new(World::new(scenery)),
            cars: Arc::new(Cars::new(&route, path.duration_s(), config.sensor_seed())),
            path,
        })
    }

    pub fn config(&self) -> &SimulationConfig {
        &self.config
    }

    pub fn sampling(&self) -> &Sampling {
        &self.sampling
    }

    /// Scans in the dataset; scans beyond can be rendered too.
    pub fn scans(&self) -> usize {
        self.scans
    }

    pub fn path(&self) -> &dyn Path {
        self.path.as_ref()
    }

    pub fn world(&self) -> &World {
        &self.world
    }

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

    pub(crate) fn drive_time_s(&self, stamp_ns: i64) -> f64 {
        (stamp_ns - self.span().0) as f64 * 1e-9
    }

    /// The start of the drive, ns since 1970, and its duration, s.
    pub(crate) fn span(&self) -> (i64, f64) {
        let end_s = self.scans as f64 * self.sampling.period_us as f64 * 1e-6;
        (EPOCH_US * 1000, end_s)
    }

    /// The samples of a sensor beside the radar, by their stamps. `None` if the drive has no such
    /// sensor.
    pub(crate) fn records(&self, kind: &Kind) -> Option<Vec<Record>> {
        let device = self.config.device(kind.of, self.path())?;
        Some(device.records(self.span()))
    }

    pub fn sensor(&self) -> Sensor {
        let Self { config, .. } = self;
        let is_exact = config.realism == Realism::Exact;
        Sensor::new(&config.sensor, is_exact, config.sensor_seed())
    }

    pub fn limits(&self) -> ScanLimits {
        ScanLimits {
            bytes: self.sampling.azimuths * self.sampling.stride(),
            azimuths: self.sampling.azimuths,
        }
    }

    /// Renders scan `index`: the same bytes whenever and on whatever thread it is called.
    /// It has the layout of an Oxford image, whose bytes are the image's, metadata included.
    pub fn render_scan(&self, index: usize) -> OwnedScan {
        let mut scan = OwnedScan::with_limits(self.limits());
        scan.geometry = self.render_into(index, &mut self.sensor(), &mut scan.slot());
        scan
    }

    /// Renders scan `index` into existing memory, of at least the size of [`Simulator::limits`].
    pub fn render_into(
        &self,
        index: usize,
        sensor: &mut Sensor,
        slot: &mut ScanSlot<'_>,
    ) -> SweepGeometry {
        let time = self.time(index);
        let middle_s = time.drive_time_s(time.middle_us());
        let place = Point2::from(self.path.pose(middle_s).translation.vector);
        let movers = self
            .cars
            .near(place, self.sampling.reach_m() + BEYOND_M, middle_s);
        let blind_s = self.config.blind_s.unwrap_or_default();
        let scene = Scene {
            world: &self.world,
            movers: &movers,
            path: self.path.as_ref(),
            blind: (blind_s[0]..blind_s[1]).contains(&middle_s),
        };
        sensor.sweep(scene, time, index as u64, slot)
    }
}

/// The number of scans of a drive. A scan counts if at least its first half is driven before the
/// end.
fn scans(wanted: Option<usize>, duration_s: f64, period_s: f64) -> Result<usize, SimulatorError> {
    if duration_s.is_infinite() {
        return Ok(wanted.unwrap_or(ENDLESS_SCANS));
    }
    let most = (duration_s / period_s + 0.5) as usize;
    match wanted {
        Some(scans) if scans > most => Err(SimulatorError::Refused(format!(
            "`simulation.scans` is {scans}, but the drive ends after {most} scans ({duration_s:.1} s): take at most so many, or leave the key out"
        ))),
        Some(scans) => Ok(scans),
        None => Ok(most.clamp(1, MAX_SCANS)),
    }
}
