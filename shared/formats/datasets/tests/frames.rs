//! Poses in space, with roll and pitch.

use std::{fmt::Write, fs};

use crate::common::assert_refused;
use gyre_datasets::{TrajectoryError, read_trajectory};
use gyre_geometry::{Pose, pose};
use gyre_radar::Trajectory;
use nalgebra::{Isometry3, Matrix3, Translation3, UnitQuaternion, Vector3};

const START_US: i64 = 1_630_597_331_000_000;
/// A place in UTM, m.
const CORNER_M: [f64; 3] = [623_422.85, 4_848_820.47, 153.98];

fn read(text: &str) -> Result<Trajectory, TrajectoryError> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("poses.txt");
    fs::write(&path, text).unwrap();
    read_trajectory(&path)
}

/// A vehicle (x forward, y left, z up) on a hilly road that leans in its bends.
fn drive(bend: f64) -> Vec<Isometry3<f64>> {
    let mut position = Vector3::zeros();
    let step = |k: u32| {
        let t = f64::from(k) * 0.02;
        let (roll, pitch) = (0.04 * (3.0 * t).cos(), 0.07 * (1.7 * t).sin());
        let turn = UnitQuaternion::from_euler_angles(roll, pitch, bend * t);
        let here = Isometry3::from_parts(position.into(), turn);
        position += turn * Vector3::new(1.3, 0.0, 0.0);
        here
    };
    (0..300).map(step).collect()
}

/// The drive in the plane: position, and direction of the x axis.
fn planar(drive: &[Isometry3<f64>]) -> Vec<Pose> {
    let plane = |p: &Isometry3<f64>| {
        let ahead = p.rotation * Vector3::x();
        pose(p.translation.x, p.translation.y, ahead.y.atan2(ahead.x))
    };
    drive.iter().map(plane).collect()
}

fn kitti_line(pose: &Isometry3<f64>) -> String {
    let m = pose.to_homogeneous();
    let row = |r: usize| [0, 1, 2, 3].map(|c| format!("{:.15e}", m[(r, c)]));
    [0, 1, 2].map(row).as_flattened().join(" ") + "\n"
}

fn kitti(drive: &[Isometry3<f64>]) -> String {
    drive.iter().map(kitti_line).collect()
}

fn tum(drive: &[Isometry3<f64>]) -> String {
    let line = |(k, pose): (usize, &Isometry3<f64>)| {
        let place = pose.translation.vector.iter().map(|x| format!("{x:.12}"));
        let turn = pose.rotation.coords.iter().map(|x| format!("{x:.15}"));
        format!("{k} {}\n", place.chain(turn).collect::<Vec<_>>().join(" "))
    };
    drive.iter().enumerate().map(line).collect()
}

fn assert_near(found: &[Pose], expected: &[Pose], apart_m: f64) {
    assert_eq!(found.len(), expected.len());
    for (k, (found, expected)) in found.iter().zip(expected).enumerate() {
        let apart = found.translation.vector - expected.translation.vector;
        let turn = found.rotation.angle_to(&expected.rotation).abs();
        let is_near = apart.norm() < apart_m && turn < 1e-6;
        assert!(is_near, "{k}: {found} instead of {expected}");
    }
}

#[test]
fn boreas_odometry_is_inverted_in_space_and_then_projected() {
    let corner = Translation3::from(Vector3::from(CORNER_M));
    let drive: Vec<_> = drive(0.3).iter().map(|pose| corner * pose).collect();
    let mut text = String::new();
    for (k, pose) in drive.iter().enumerate() {
        let line = kitti_line(&pose.inverse());
        let _ = write!(text, "{} {line}", START_US + 100_000 * k as i64);
    }
    let found = read(&text).unwrap();
    assert_near(&found.poses, &planar(&drive), 1e-5);
    assert_eq!(found.stamp_ns.unwrap()[1], (START_US + 100_000) * 1000);
}

/// Where the world is the first frame of a sensor with y to the right and z down.
#[test]
fn boreas_odometry_from_the_first_frame_is_mirrored() {
    let down = UnitQuaternion::from_axis_angle(&Vector3::x_axis(), std::f64::consts::PI);
    let drive = drive(0.3);
    let first = drive[0].inverse();
    let drive: Vec<_> = drive.iter().map(|pose| first * pose).collect();
    let mut text = String::new();
    for (k, pose) in drive.iter().enumerate() {
        let line = kitti_line(&(down * pose.inverse() * down));
        let _ = write!(text, "{} {line}", START_US + 100_000 * k as i64);
    }
    assert_near(&read(&text).unwrap().poses, &planar(&drive), 1e-9);
}

#[test]
fn an_index_before_the_poses_is_skipped() {
    let line = kitti_line(&Isometry3::identity());
    assert!(read(&format!("7 {line}")).unwrap().stamp_ns.is_none());
}

#[test]
fn poses_in_space_are_projected_to_the_plane() {
    for bend in [0.0, 0.02, 0.9] {
        let drive = drive(bend);
        let expected = planar(&drive);
        assert_near(&read(&kitti(&drive)).unwrap().poses, &expected, 1e-6);
        assert_near(&read(&tum(&drive)).unwrap().poses, &expected, 1e-6);
    }
    let turns = (0..40).map(|k| UnitQuaternion::from_euler_angles(0.0, 0.0, 0.1 * f64::from(k)));
    let standing: Vec<_> = turns
        .map(|turn| Isometry3::from_parts(Translation3::identity(), turn))
        .collect();
    assert_near(
        &read(&kitti(&standing)).unwrap().poses,
        &planar(&standing),
        1e-9,
    );
}

#[test]
fn poses_of_no_known_frame_are_refused() {
    // x is up.
    let axes = Matrix3::new(0.0, 0.0, 1.0, 0.0, 1.0, 0.0, -1.0, 0.0, 0.0);
    let axes = UnitQuaternion::from_matrix(&axes);
    let tilted: Vec<_> = drive(0.9).iter().map(|pose| axes * pose).collect();
    for text in [kitti(&tilted), tum(&tilted)] {
        assert_refused(read(&text), "does not stay upright");
    }
}

/// On a straight road, a camera stays upright about each axis.
#[test]
fn poses_of_a_camera_are_refused() {
    // x to the right, y down, z forward.
    let axes = Matrix3::new(0.0, -1.0, 0.0, 0.0, 0.0, -1.0, 1.0, 0.0, 0.0);
    let axes = UnitQuaternion::from_matrix(&axes);
    for bend in [0.0, 0.02, 0.9] {
        let camera = |pose: &Isometry3<f64>| axes * pose * axes.inverse();
        let camera: Vec<_> = drive(bend).iter().map(camera).collect();
        for text in [kitti(&camera), tum(&camera)] {
            assert_refused(read(&text), "turn the poses of a camera");
        }
    }
}
