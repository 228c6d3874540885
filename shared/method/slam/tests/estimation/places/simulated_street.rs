//! A simulated street, driven out and back.

use std::{f64::consts::PI, fs, path::Path};

use gyre_geometry::{OwnedScan, Pose, SparsePoint, Twist, pose, xy_yaw};
use gyre_matching::{RefinementConfig, Submap};
use gyre_radar::{PointExtractor, PointsConfig};
use gyre_simulator::{SimulatedDrive, SimulationConfig};
use gyre_slam::estimation::places::{
    Describer, Descriptor, KeyframeSelector, LoopVerifier, MAX_NEIGHBOURS, PlaceIndex,
    SUBMAP_REACH_M, VerificationOutcome, neighbours,
};

const FLOOR: u8 = 60;
const PERIOD_S: f64 = 0.25;
const STREET_M: f64 = 70.0;
/// Radius of the turn: the lanes are twice as far from each other.
const TURN_M: f64 = 2.5;

struct Keyframe {
    pose: Pose,
    path_m: f64,
    twist: Twist,
    points: Vec<SparsePoint>,
}

/// Pose `s` metres along the path: out, half a turn to the left, and back.
fn at(s: f64) -> Pose {
    let angle = ((s - STREET_M) / TURN_M).clamp(0.0, PI);
    let back = (s - STREET_M - PI * TURN_M).max(0.0);
    let x = s.min(STREET_M) + TURN_M * angle.sin() - back;
    pose(x, TURN_M * (1.0 - angle.cos()), angle)
}

/// Writes the poses at every scan: 11 m/s on the street, 3 m/s in the turn. Returns their number.
fn write_drive(file: &Path) -> usize {
    let (mut s, mut text, mut count) = (0.0, String::new(), 0);
    while s < 2.0 * STREET_M + PI * TURN_M {
        let [x, y, yaw] = xy_yaw(&at(s));
        let (sin, cos) = (0.5 * yaw).sin_cos();
        let stamp_s = 1e6 + PERIOD_S * count as f64;
        text += &format!("{stamp_s} {x} {y} 0 0 0 {sin} {cos}\n");
        let turns = (STREET_M - 3.0..STREET_M + PI * TURN_M).contains(&s);
        s += PERIOD_S * if turns { 3.0 } else { 11.0 };
        count += 1;
    }
    fs::write(file, text).unwrap();
    count
}

fn simulate() -> Vec<Keyframe> {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("street.tum");
    let mut config = SimulationConfig {
        scans: Some(write_drive(&file) - 2),
        ..SimulationConfig::default()
    };
    config.drive.file = Some(file);
    let drive = SimulatedDrive::new(&config).unwrap();
    let mut dataset =
        gyre_datasets::open_source(Box::new(drive.renderer()), &drive.dataset_options()).unwrap();
    let mut scan = OwnedScan::with_limits(dataset.limits());
    let mut extractor = PointExtractor::new(&PointsConfig::default()).unwrap();
    let mut points = vec![SparsePoint::default(); 8192];
    let poses: Vec<Pose> = (0..drive.scans())
        .map(|k| drive.simulator().pose(k))
        .collect();
    let mut selector = KeyframeSelector::default();
    let keyframe = |k: usize| {
        let path_m = selector.next(&poses[k])?;
        scan.geometry = dataset.read(k, scan.slot()).unwrap();
        let count = extractor.extract(&scan.view(), FLOOR, &mut points).unwrap();
        let (before, after) = (k.saturating_sub(1), (k + 1).min(poses.len() - 1));
        let interval_s = (after - before) as f64 * PERIOD_S;
        Some(Keyframe {
            pose: poses[k],
            path_m,
            twist: Twist::from_chord(&poses[before].inv_mul(&poses[after]), interval_s),
            points: points[..count].to_vec(),
        })
    };
    (0..poses.len()).filter_map(keyframe).collect()
}

fn submap(keyframes: &[Keyframe], path_m: &[f64], middle: usize) -> Submap {
    let mut submap = Submap::with_capacity(8192 * (2 * MAX_NEIGHBOURS + 1));
    let here = &keyframes[middle];
    submap.start(&here.points, &here.twist);
    for k in neighbours(path_m, middle, SUBMAP_REACH_M) {
        if k != middle {
            let there = &keyframes[k];
            submap.add(&there.points, &there.twist, &here.pose.inv_mul(&there.pose));
        }
    }
    submap
}

#[test]
fn a_street_driven_back_is_recognised_and_the_loops_are_right() {
    let keyframes = simulate();
    let path_m: Vec<f64> = keyframes.iter().map(|it| it.path_m).collect();
    let submaps: Vec<Submap> = (0..keyframes.len())
        .map(|k| submap(&keyframes, &path_m, k))
        .collect();
    let (mut describer, mut index) = (Describer::new(), PlaceIndex::default());
    let mut verifier = LoopVerifier::new(&RefinementConfig::default(), 8192).unwrap();
    let (mut returned, mut closed) = (0, 0);
    for (k, submap) in submaps.iter().enumerate() {
        let mut descriptor = Descriptor::default();
        describer.describe(submap, &mut descriptor);
        index.insert(k as u64, path_m[k], &descriptor).unwrap();
        // On the way back, where the other lane is at least 50 m of path ago.
        let eligible = index.places_until(path_m[k] - 50.0);
        let distance_m = |place: usize| {
            let apart = keyframes[place].pose.inv_mul(&keyframes[k].pose);
            apart.translation.vector.norm()
        };
        if !(0..eligible).any(|place| distance_m(place) < 2.0 * TURN_M + 1.0) {
            continue;
        }
        returned += 1;
        let mut is_closed = false;
        for found in index.query(&descriptor, eligible, 15.0).iter().take(3) {
            let truth = keyframes[found.place].pose.inv_mul(&keyframes[k].pose);
            let verified = verifier.verify(submap, &submaps[found.place], found);
            if verified.outcome == VerificationOutcome::Accepted {
                let error = verified.motion.error(&truth);
                let is_near = error.xy().norm() < 0.15 && error.z.abs() < 0.005;
                assert!(is_near, "{k}: {error:?}");
                is_closed = true;
            }
        }
        closed += usize::from(is_closed);
    }
    assert!(
        returned >= 8 && closed == returned,
        "{closed} of {returned}"
    );
}
