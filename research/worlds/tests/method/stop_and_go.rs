//! Odometry of a simulated vehicle that stands in traffic, creeps and drives off:
//! `research/worlds/configs/stop-and-go.toml`.

use std::{fs, path::Path};

use gyre_datasets::open_source;
use gyre_matching::odometry::{Odometry, OdometryConfig};
use gyre_geometry::OwnedScan;
use gyre_worlds::{Profile, SimulatedDrive, SimulationConfig};
use serde::Deserialize;

const PROJECT: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../..");
/// Speeds below and above which a vehicle counts as standing and moving, m/s.
const STANDING_MPS: f64 = 0.02;
const MOVING_MPS: f64 = 0.3;

#[derive(Deserialize)]
struct Configuration {
    simulation: SimulationConfig,
    #[serde(flatten)]
    odometry: OdometryConfig,
}

/// Length of the path and number of scans by true speed, with what odometry says of both.
#[derive(Debug, Default)]
struct Part {
    scans: usize,
    stationary: usize,
    true_m: f64,
    path_m: f64,
}

#[derive(Debug, Default)]
struct Report {
    standing: Part,
    creeping: Part,
    moving: Part,
    worst_m: f64,
}

impl Report {
    fn at(&mut self, speed_mps: f64) -> &mut Part {
        match speed_mps {
            ..STANDING_MPS => &mut self.standing,
            MOVING_MPS.. => &mut self.moving,
            _ => &mut self.creeping,
        }
    }

    /// Length of the path, as odometry and the truth have it.
    fn path_m(&self) -> [f64; 2] {
        let parts = [&self.standing, &self.creeping, &self.moving];
        [
            parts.iter().map(|part| part.path_m).sum(),
            parts.iter().map(|part| part.true_m).sum(),
        ]
    }

    #[track_caller]
    fn holds(&self) {
        let share = |part: &Part| part.stationary as f64 / part.scans as f64;
        assert!(share(&self.standing) >= 0.95, "{self:?}");
        assert!(share(&self.moving) < 0.01, "{self:?}");
        let [path_m, true_m] = self.path_m();
        assert!((path_m / true_m - 1.0).abs() < 0.1, "{self:?}");
        assert!(self.standing.path_m < 0.5, "{self:?}");
        let creeping = &self.creeping;
        assert!(
            (creeping.path_m / creeping.true_m - 1.0).abs() < 0.1,
            "{self:?}"
        );
        assert!(self.worst_m < 1.0, "{self:?}");
    }
}

fn configuration(profile: Profile) -> Configuration {
    let read = |file: &str| fs::read_to_string(Path::new(PROJECT).join(file)).unwrap();
    let table = |file: &str| read(file).parse::<toml::Table>().unwrap();
    let mut text = table("configs/stop-and-go.toml");
    text.extend(table("research/worlds/configs/stop-and-go.toml"));
    let mut config: Configuration = text.try_into().unwrap();
    config.simulation.drive.file = Some(Path::new(PROJECT).join("configs/stop-and-go.tum"));
    config.simulation.sensor.profile = profile;
    config
}

fn drive(config: &Configuration) -> Report {
    let drive = SimulatedDrive::new(&config.simulation).unwrap();
    let mut scans = open_source(
        Box::new(drive.renderer()),
        &config.simulation.dataset_options(),
    )
    .unwrap();
    let mut odometry = Odometry::new(&config.odometry).unwrap();
    let mut scan = OwnedScan::with_limits(scans.limits());
    let start = drive.simulator().pose(0);
    let (mut report, mut stamp_ns) = (Report::default(), 0);
    for index in 0..scans.len() {
        scan.geometry = scans.read(index, scan.slot()).unwrap();
        let registered = odometry.register(&scan.view(), &[]).unwrap();
        let truth = drive.simulator().pose(index);
        let before_ns = std::mem::replace(&mut stamp_ns, scan.geometry.stamp_ns);
        if index > 0 {
            let seconds = (stamp_ns - before_ns) as f64 * 1e-9;
            let before = drive.simulator().pose(index - 1);
            let true_m = (truth.translation.vector - before.translation.vector).norm();
            let part = report.at(true_m / seconds);
            part.scans += 1;
            part.true_m += true_m;
            part.path_m += registered.motion.motion.translation.vector.norm();
            part.stationary += usize::from(registered.refined.unwrap().stationary);
        }
        let off = (start * registered.pose.motion).inv_mul(&truth);
        report.worst_m = report.worst_m.max(off.translation.vector.norm());
    }
    report
}

/// A table: with `--ignored --nocapture`, in a release build.
#[test]
#[ignore = ".ci/nightly: renders 680 scans of each radar, twice"]
fn stop_and_go_of_several_radars() {
    println!(
        "| radar | held | path | while standing | while creeping | `stationary` standing, moving |"
    );
    for profile in [Profile::Cts350xOxford, Profile::Cir204h, Profile::Ras6] {
        for held in [false, true] {
            let mut config = configuration(profile);
            config.odometry.refinement.hold_standstill = held;
            let report = drive(&config);
            let [path_m, true_m] = report.path_m();
            let (standing, creeping) = (&report.standing, &report.creeping);
            println!(
                "| {profile:?} | {held} | {path_m:.1} m of {true_m:.1} m | {:.2} m | {:.2} m of {:.2} m | {} of {}, {} of {} |",
                standing.path_m,
                creeping.path_m,
                creeping.true_m,
                standing.stationary,
                standing.scans,
                report.moving.stationary,
                report.moving.scans,
            );
            if held {
                report.holds();
            }
        }
    }
}
