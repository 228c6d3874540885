//! A tunnel of 300 m, whose walls look the same everywhere: the radar does not see how far the
//! vehicle drives.

use std::fmt::Write as _;

use gyre_geometry::{ComposedMotion, Pose, xy_yaw};
use gyre_odometry::{Odometry, OdometryConfig, Registered};
use gyre_radar::{GyroLog, OwnedScan, ScanSamples, WheelLog, open_source};
use gyre_samples::{GyroKind, WheelsKind};
use gyre_scan_matching::Outcome;
use gyre_simulator::{DrivingSide, SimulatedDrive, SimulationConfig, TunnelConfig};

/// Way to the tunnel, its length, and the way behind it, m.
const BEFORE_M: f64 = 150.0;
const TUNNEL_M: f64 = 300.0;
const BEHIND_M: f64 = 100.0;

/// A road with wide bends, on which the vehicle drives now faster, now slower.
fn road() -> String {
    let (mut text, mut driven_m, mut place) = (String::new(), 0.0_f64, [0.0_f64; 2]);
    const STEP_S: f64 = 0.1;
    for step in 0.. {
        let time_s = f64::from(step) * STEP_S;
        let yaw_rad = 0.15 * (driven_m / 110.0).sin();
        let _ = writeln!(
            text,
            "{time_s:.1} {:.4} {:.4} 0 0 0 {:.9} {:.9}",
            place[0],
            place[1],
            (yaw_rad / 2.0).sin(),
            (yaw_rad / 2.0).cos()
        );
        if driven_m > BEFORE_M + TUNNEL_M + BEHIND_M {
            return text;
        }
        let step_m = STEP_S * (9.0 + 2.5 * (time_s / 4.0).sin());
        driven_m += step_m;
        place = [place[0] + step_m * yaw_rad.cos(), place[1] + step_m * yaw_rad.sin()];
    }
    text
}

fn simulation(seed: u64, folder: &std::path::Path) -> SimulationConfig {
    let file = folder.join("road.tum");
    std::fs::write(&file, road()).unwrap();
    let mut config: SimulationConfig = toml::from_str("realism = \"road\"").unwrap();
    config.seed = seed;
    config.drive = gyre_simulator::drive::DriveConfig::along_file(file);
    config.drive.keep = DrivingSide::Left;
    config.gyro.profile = gyre_simulator::GyroProfile::Asm330lhh;
    config.wheels.rate_hz = 50.0;
    config.effects.miscalibration = Some(false);
    config.tunnels = vec![TunnelConfig {
        from_m: BEFORE_M,
        length_m: TUNNEL_M,
    }];
    config
}

#[test]
#[ignore = "experiment"]
fn experiment() {
    let seed: u64 = std::env::var("SEED").map_or(1, |seed| seed.parse().unwrap());
    let folder = tempfile::tempdir().unwrap();
    let simulation = simulation(seed, folder.path());
    let drive = SimulatedDrive::new(&simulation).unwrap();
    let mut scans = open_source(Box::new(drive.renderer()), &simulation.dataset_options()).unwrap();
    let mut all = Vec::new();
    for index in 0..scans.len() {
        let mut scan = OwnedScan::with_limits(scans.limits());
        scan.geometry = scans.read(index, scan.slot()).unwrap();
        all.push(scan);
    }
    for variant in ["radar", "gyro", "both"] {
        let mut config = OdometryConfig::default();
        config.refinement.scale_sigma = 0.0;
        if variant != "radar" {
            config.gyro.kind = GyroKind::Auto;
        }
        if variant == "both" {
            config.wheels.kind = WheelsKind::Auto;
        }
        let path = std::path::Path::new("simulation");
        let gyro = GyroLog::of(drive.gyro_samples().unwrap(), path).unwrap();
        let wheels = WheelLog::of(drive.wheel_samples().unwrap(), path).unwrap();
        let turns = ScanSamples::of_gyro(&gyro, &config.gyro, scans.as_ref()).unwrap();
        let speeds = ScanSamples::of_wheels(&wheels, &config.wheels, scans.as_ref()).unwrap();
        let samples = match variant {
            "radar" => ScanSamples::None,
            "gyro" => turns,
            _ => turns.and(speeds),
        };
        let mut odometry = Odometry::new(&config).unwrap();
        let mut registered: Vec<Registered> = Vec::new();
        for scan in &all {
            let view = scan.view();
            let of = samples.of(scans.as_ref(), view.span_ns()).into_owned();
            registered.push(odometry.register(&view, &of).unwrap());
        }
        let sim = drive.simulator();
        let mut driven_m = 0.0;
        let mut reference: Option<(Pose, ComposedMotion)> = None;
        let mut nees = Vec::new();
        for k in 1..all.len() {
            let (before, here) = (sim.pose(k - 1), sim.pose(k));
            let truth = before.inv_mul(&here);
            let step_m = truth.translation.vector.norm();
            driven_m += step_m;
            let it = &registered[k];
            let off = truth.inv_mul(&it.motion.motion);
            let inside = driven_m > BEFORE_M && driven_m < BEFORE_M + TUNNEL_M;
            if inside && reference.is_none() {
                reference = Some((before, ComposedMotion::new()));
            }
            let mut line = String::new();
            if let Some((from, composed)) = reference.as_mut() {
                *composed = match nees.is_empty() {
                    true => ComposedMotion::of(&it.motion),
                    false => composed.then(&it.motion),
                };
                let expected = from.inv_mul(&here);
                let apart = expected.inv_mul(&composed.motion().motion);
                let value = {
                    let [x, y, yaw] = xy_yaw(&composed.motion().motion);
                    let [tx, ty, tyaw] = xy_yaw(&expected);
                    let e = nalgebra_vector([x - tx, y - ty, yaw - tyaw]);
                    let covariance = composed.motion().covariance;
                    quadratic(&e, &covariance)
                };
                nees.push(value);
                line = format!(
                    "end {:.2} {:.2} yaw {:.2} sigma {:.2} nees {:.2}",
                    apart.translation.x,
                    apart.translation.y,
                    apart.rotation.angle().to_degrees(),
                    composed.motion().covariance[(0, 0)].sqrt(),
                    value
                );
                if !inside {
                    println!(
                        "{variant} END after {driven_m:.0} m: {:.2} m, NEES mean {:.2}",
                        apart.translation.vector.norm(),
                        nees.iter().sum::<f64>() / nees.len() as f64
                    );
                    if driven_m > BEFORE_M + TUNNEL_M + 20.0 {
                        reference = None;
                        nees.clear();
                    }
                }
            }
            println!(
                "{variant} {k} at {driven_m:.0} {} off {:.2} {:.2} {:.2} deg cov {:.3} {} {line}",
                if inside { "TUNNEL" } else { "" },
                off.translation.x,
                off.translation.y,
                off.rotation.angle().to_degrees(),
                it.motion.covariance[(0, 0)].sqrt(),
                match it.outcome {
                    outcome => format!("{outcome:?}"),
                },
            );
        }
    }
    let _ = Outcome::Refined;
}

fn nalgebra_vector(values: [f64; 3]) -> [f64; 3] {
    values
}

fn quadratic(e: &[f64; 3], covariance: &nalgebra::Matrix3<f64>) -> f64 {
    let e = nalgebra::Vector3::from(*e);
    covariance
        .try_inverse()
        .map_or(f64::NAN, |inverse| (e.transpose() * inverse * e)[0] / 3.0)
}
