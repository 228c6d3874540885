//! A radar in a scene, and its scans.

use std::sync::Arc;

use gyre_geometry::{Pose, Twist, OwnedScan, ScanLimits};
use gyre_worlds::{profile::Profile, weather::WeatherConfig, Body, Effects, Movers, Path, Scene, Sensor, SensorConfig, SimulationConfig, Simulator, SimulatorError, SweepTime, World};

const SEED: u64 = 1;
const EPOCH_US: i64 = 1_547_132_400_000_000;

/// A scene and a radar in it at one scan.
#[derive(Clone)]
pub struct Shot {
    pub world: Arc<World>,
    pub movers: Arc<dyn Movers>,
    pub path: Arc<dyn Path>,
    pub weather: WeatherConfig,
    pub sensor: SensorConfig,
    pub effects: Effects,
    /// Number of the scan.
    pub index: u64,
}

/// The path of a simulator.
struct Drive(Simulator);

impl Path for Drive {
    fn pose(&self, time_s: f64) -> Pose {
        self.0.path().pose(time_s)
    }
}

impl Shot {
    /// Oxford's radar at rest in a synthetic scene, with noise and no other effect.
    pub fn drawn(scene: Body) -> Self {
        Self {
            world: Arc::new(World::new(scene)),
            movers: Arc::new(()),
            path: Arc::new(Twist::default()),
            weather: WeatherConfig::default(),
            sensor: SensorConfig::default(),
            effects: Effects {
                noise: true,
                ..Effects::NONE
            },
            index: 0,
        }
    }

    /// A radar on a drive through the town, with all effects except random events.
    pub fn town(profile: Profile) -> Result<Self, SimulatorError> {
        let simulator = Simulator::new(&SimulationConfig {
            seed: SEED,
            ..SimulationConfig::default()
        })?;
        Ok(Self {
            world: Arc::new(simulator.world().clone()),
            path: Arc::new(Drive(simulator)),
            sensor: SensorConfig {
                profile,
                ..SensorConfig::default()
            },
            effects: Effects {
                interference: false,
                dropped_azimuths: false,
                ..Effects::ALL
            },
            ..Self::drawn(Body::default())
        })
    }

    /// Sets a constant velocity: m/s ahead and rad/s to the left.
    pub fn driving(self, vx_mps: f64, yaw_rate_radps: f64) -> Self {
        Self {
            path: Arc::new(Twist {
                vx_mps,
                vy_mps: 0.0,
                yaw_rate_radps,
            }),
            ..self
        }
    }

    /// Sets the radar.
    pub fn with(self, profile: Profile) -> Self {
        Self {
            sensor: SensorConfig {
                profile,
                ..self.sensor
            },
            ..self
        }
    }

    /// Returns the same scan with other effects.
    pub fn with_effects(&self, change: impl FnOnce(&mut Effects)) -> Self {
        let mut shot = self.clone();
        change(&mut shot.effects);
        shot
    }

    /// Measures the scan.
    pub fn scan(&self) -> OwnedScan {
        let sampling = self.sensor.sampling();
        let (azimuths, period_us) = (sampling.azimuths, sampling.period_us);
        let mut scan = OwnedScan::with_limits(ScanLimits {
            bytes: azimuths * sampling.stride(),
            azimuths,
        });
        // The path's time zero is the middle of the first sweep, so the sensor is at the origin of
        // a synthetic scene.
        let start_us = EPOCH_US + period_us * self.index as i64 - period_us / 2;
        let time = SweepTime {
            start_us,
            period_us,
            azimuths,
            epoch_us: EPOCH_US,
        };
        let scene = Scene {
            world: &self.world,
            movers: self.movers.as_ref(),
            path: self.path.as_ref(),
            weather: self.weather,
        };
        let mut sensor = Sensor::new(&self.sensor, &self.effects, SEED);
        scan.geometry = sensor.sweep(scene, time, self.index, &mut scan.slot());
        scan
    }

    /// Measures `count` scans from this one on.
    pub fn scans(&self, count: u64) -> Vec<OwnedScan> {
        let mut shot = self.clone();
        let indices = self.index..self.index + count;
        indices
            .map(|index| {
                shot.index = index;
                shot.scan()
            })
            .collect()
    }
}
