//! Odometry with a search of your own: a gyroscope measures the rotation, the radar finds the
//! translation.
//!
//! ```sh
//! cargo run --release -p gyre-matching --example own_search
//! ```
//!
//! Here both sensors are simulated. Yours come from drivers: `GyroscopeSearch` stays. A mask of
//! your own is passed in the same way, as the part `masker`.

use std::error::Error;

use gyre_matching::{
    JointMatch, RotationMatch, TranslationSearch,
    odometry::{Odometry, OdometryConfig, OdometryError, Pair, Parts, Registered, Search},
};
use gyre_simulator::{SimulationConfig, Simulator};

/// Time between two readings.
const PERIOD_NS: i64 = 2_500_000;
/// Standard deviation of the angle between two scans.
pub(crate) const SIGMA_RAD: f64 = 0.002;

/// A reading of the gyroscope.
struct Reading {
    stamp_ns: i64,
    yaw_rate_radps: f64,
}

/// Sums up the gyroscope's readings between two scans, and searches the translation at that angle.
struct GyroscopeSearch {
    readings: Vec<Reading>,
    translation: TranslationSearch,
}

impl Search for GyroscopeSearch {
    fn search(&mut self, pair: &Pair) -> Result<Option<JointMatch>, OdometryError> {
        let Some(earlier) = pair.earlier() else {
            return Ok(None);
        };
        let [from_ns, to_ns] = pair.stamps_ns();
        let between = |reading: &&Reading| (from_ns..to_ns).contains(&reading.stamp_ns);
        let rates_radps = self.readings.iter().filter(between);
        let sum_radps: f64 = rates_radps.map(|reading| reading.yaw_rate_radps).sum();
        let rotation = RotationMatch {
            angle_rad: sum_radps * PERIOD_NS as f64 * 1e-9,
            variance_rad2: SIGMA_RAD.powi(2),
            score: 1.0,
            runner_up: None,
        };
        let motion = self.translation.search(pair.later(), earlier, &rotation)?;
        Ok(Some(JointMatch { rotation, motion }))
    }
}

fn main() -> Result<(), Box<dyn Error>> {
    let config = SimulationConfig {
        scans: Some(20),
        ..SimulationConfig::default()
    };
    for registered in drive(&Simulator::new(&config)?)? {
        let (outcome, pose) = (registered.outcome, registered.pose.motion);
        println!("{} {outcome:?} {pose}", registered.seq);
    }
    Ok(())
}

/// Registers the scans of a drive.
pub(crate) fn drive(simulator: &Simulator) -> Result<Vec<Registered>, Box<dyn Error>> {
    let config = OdometryConfig::default();
    let (n, cell_m) = (config.raster.n, config.raster.cell_m.into());
    let search = GyroscopeSearch {
        readings: read_gyroscope(simulator),
        translation: TranslationSearch::new(n, cell_m, &config.translation)?,
    };
    let parts = Parts {
        search: Box::new(search),
        ..Parts::new(&config)?
    };
    let mut odometry = Odometry::with_parts(&config, parts);
    let scans = (0..simulator.scans()).map(|index| simulator.render_scan(index));
    scans
        .map(|scan| Ok(odometry.register(&scan.view(), &[])?))
        .collect()
}

/// Returns the rotations of an ideal gyroscope from the first scan to the last.
fn read_gyroscope(simulator: &Simulator) -> Vec<Reading> {
    let (first, last) = (simulator.time(0), simulator.time(simulator.scans()));
    let heading_rad = |stamp_ns: i64| {
        let time_s = first.drive_time_s(stamp_ns / 1000);
        simulator.path().pose(time_s).rotation
    };
    let stamps_ns = (first.start_us * 1000..last.start_us * 1000).step_by(PERIOD_NS as usize);
    stamps_ns
        .map(|stamp_ns| {
            let turned = heading_rad(stamp_ns).inverse() * heading_rad(stamp_ns + PERIOD_NS);
            Reading {
                stamp_ns,
                yaw_rate_radps: turned.angle() / (PERIOD_NS as f64 * 1e-9),
            }
        })
        .collect()
}
