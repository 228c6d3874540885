//! Ground truth and pose files, real and generated.

use std::{fmt::Write, fs};

use crate::common::{assert_refused, real};
use gyre_datasets::{TrajectoryError, find_ground_truth, read_trajectory, write_kitti, write_tum};
use gyre_geometry::{Pose, pose};
use gyre_radar::Trajectory;
use nalgebra::{Isometry2, Isometry3, Matrix3, Translation3, UnitQuaternion, Vector2, Vector3};
use proptest::prelude::*;

fn from_text(name: &str, text: &str) -> Result<Trajectory, TrajectoryError> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join(name);
    fs::write(&path, text).unwrap();
    read_trajectory(&path)
}

const HEADER: &str = "source_timestamp,destination_timestamp,x,y,z,roll,pitch,yaw,source_radar_timestamp,destination_radar_timestamp\n";

fn row(from: i64, to: i64, x: f64, y: f64, yaw: f64) -> String {
    let [to, from] = [to, from].map(|us| 1_547_131_046_000_000 + us);
    format!("{to},{from},{x},{y},0,0,0,{yaw},{to},{from}\n")
}

#[test]
fn oxford_motions_are_converted_to_rep_103_and_composed_from_identity() {
    // 2 m ahead with a right turn of 90 degrees, then 1 m ahead and 0.5 m to the right. Rows may be
    // in any order.
    let quarter = std::f64::consts::FRAC_PI_2;
    let (later, earlier) = (row(250, 500, 1.0, 0.5, 0.0), row(0, 250, 2.0, 0.0, quarter));
    let text = [HEADER, &later, &earlier].concat();
    let trajectory = from_text("radar_odometry.csv", &text).unwrap();
    let stamps = trajectory.stamp_ns.as_deref().unwrap();
    assert_eq!(stamps[2] - stamps[0], 500_000);
    assert_eq!(trajectory.poses[0], Isometry2::identity());
    assert!((trajectory.poses[1].rotation.angle() + quarter).abs() < 1e-12);
    let last = trajectory.poses[2].translation.vector;
    assert!((last - Vector2::new(1.5, -1.0)).norm() < 1e-12, "{last}");
    let (first, second) = (row(0, 250, 2.0, 0.0, 0.0), row(500, 750, 1.0, 0.5, 0.0));
    let refused = from_text("radar_odometry.csv", &[HEADER, &first, &second].concat());
    assert_refused(refused, "line 3: this motion starts 0.000250 s after");
}

#[test]
fn the_oxford_drive_is_nine_kilometres() {
    let Some(root) = real("trajectories") else {
        return;
    };
    let file = root.join("oxford-2019-01-10-11-46-21.radar_odometry.csv");
    let trajectory = read_trajectory(&file).unwrap();
    assert_eq!(trajectory.len(), 8866);
    let path_m = trajectory.path_length_m();
    assert!((8_900.0..9_200.0).contains(&path_m), "{path_m}");
    let golden = read_trajectory(&real("golden/csv-chain").unwrap().join("estimate.txt")).unwrap();
    // The estimate was made without mirroring y; the lengths of the paths agree nevertheless.
    let ratio = golden.path_length_m() / path_m;
    assert!((0.98..1.03).contains(&ratio), "{ratio}");
}

#[test]
fn boreas_headings_follow_the_course_over_ground() {
    let Some(root) = real("trajectories") else {
        return;
    };
    let file = root.join("boreas-2021-09-02-11-42-radar_poses.csv");
    let trajectory = read_trajectory(&file).unwrap();
    assert_eq!(trajectory.len(), 4134);
    let steps = trajectory.poses.windows(2);
    let steps = steps.map(|w| (w[0].inverse() * w[1]).translation.vector);
    let steps = steps.filter(|step| step.norm() > 1.5);
    let mut slips: Vec<f64> = steps.map(|step| step.y.atan2(step.x)).collect();
    slips.sort_by(f64::total_cmp);
    assert!(slips.len() > 500);
    let median = slips[slips.len() / 2].to_degrees();
    assert!(median.abs() < 0.2, "the vehicle slips by {median} deg");
}

#[test]
fn real_kitti_and_tum_files_are_read() {
    let Some(root) = real("golden/kitti-metric") else {
        return;
    };
    for name in ["estimate.txt", "ground_truth.txt"] {
        let trajectory = read_trajectory(&root.join(name)).unwrap();
        assert_eq!((trajectory.len(), trajectory.has_heading()), (4470, true));
        assert!(trajectory.stamp_ns.is_none());
    }
    let radiate = real("radiate-2019-02-12").unwrap().join("ground_truth.tum");
    let radiate = read_trajectory(&radiate).unwrap();
    assert_eq!(radiate.len(), 2362);
    assert_eq!(radiate.span_ns().unwrap().0, 1_549_986_606_800_100_000);
    assert!((radiate.poses[0].rotation.angle() - 2.0 * (-0.076_197_180_f64).asin()).abs() < 1e-6);
    let fomo = read_trajectory(&real("samples/fomo-2025-10-14").unwrap().join("gt.txt")).unwrap();
    assert!(!fomo.has_heading() && fomo.len() == 1692);
}

#[test]
fn invalid_files_are_rejected_with_their_line() {
    let cases = [
        ("", "empty"),
        ("1 2 3\n", "3 columns"),
        ("1 0 0 0 0 0 0 1\n2 0 0 0 0 0 x 1\n", "line 2"),
        ("1 0 0 0 0 0 0 1\n2 0 0 0 0 0 1\n", "line 2"),
        ("2 0 0 0 0 0 0 1\n1 0 0 0 0 0 0 1\n", "backwards"),
        ("1 0 0 0 0 0 0 0\n", "quaternion"),
        ("1 inf 0 0 0 0 0 1\n", "line 1"),
        // Finite, but their squares or sums are not.
        ("1 0 0 0 1e200 0 0 1e200\n", "line 1"),
        ("1 0 0 1e308 0 1 0 1e308 0 0 1 0\n", "line 1"),
        (HEADER, "no motion"),
        ("GPSTime,easting\n1,2\n", "northing"),
        // Rounded to four a second.
        (
            "# x\n1 0 0 0 0 0 0 1\n1.25 1 0 0 0 0 0 1\n1.25 1 2 0 0 0 0 1\n1.25 1 4 0 0 0 0 1\n",
            "line 4: its place is 2.0 m from a place of the same time",
        ),
    ];
    for (text, words) in cases {
        assert_refused(from_text("a.txt", text), words);
    }
    for (path, words) in [
        ("/nowhere/a.tum", "trajectory /nowhere/a.tum: No such"),
        ("/proc/self/fdinfo", "without a ground truth"),
    ] {
        assert_refused(read_trajectory(path.as_ref()), words);
    }
}

#[test]
fn what_spreadsheets_write_is_refused_with_what_to_do() {
    for (separator, number, count) in [
        (" ", "1,5", 8),
        ("\t", "1,5", 12),
        (";", "1,5", 8),
        (";", "1.5", 12),
        (", ", "1.5", 8),
        (", ", "1", 8),
        (";", "GPSTime", 3),
    ] {
        let text = vec![number; count].join(separator);
        let words = "need spaces between them in TUM and KITTI, commas in the others";
        assert_refused(from_text("a.txt", &text), words);
    }
    // The poses of the lidar of Boreas, and columns with a space behind their comma.
    let boreas = "GPSTime,easting,northing,roll,pitch,heading\n1630597331060160,3,4,0,0,0.5\n";
    let lidar = from_text("a", &boreas.replace("GPSTime", "ROSTime"));
    assert_eq!(lidar.unwrap(), from_text("a", boreas).unwrap());
    let row = "1561000444390857630,0,-1,0,353062.125,1,0,0,4026023,0,0,1,20\n";
    assert_eq!(
        from_text("global_pose.csv", &row.replace(',', ", ")).unwrap(),
        from_text("global_pose.csv", row).unwrap()
    );
}

#[test]
fn ground_truth_is_found_at_the_path_of_each_dataset() {
    for place in [
        "ground_truth.tum",
        "gt/radar_odometry.csv",
        "applanix/radar_poses.csv",
        "global_pose.csv",
        "gt.txt",
    ] {
        let root = tempfile::tempdir().unwrap();
        assert_eq!(find_ground_truth(root.path()), None);
        let path = root.path().join(place);
        fs::create_dir_all(path.parent().unwrap()).unwrap();
        fs::create_dir_all(root.path().join("radar")).unwrap();
        fs::write(&path, "").unwrap();
        assert_eq!(find_ground_truth(root.path()), Some(path.clone()));
        assert_eq!(find_ground_truth(&root.path().join("radar")), Some(path));
    }
}

fn trajectory() -> impl Strategy<Value = Trajectory> {
    let pose = (1_i64..1_000_000_000, -1e4..1e4, -1e4..1e4, -3.1..3.1);
    prop::collection::vec(pose, 1..20).prop_map(|steps| {
        let mut stamp = 1_549_986_607_000_000_000;
        let (mut stamps, mut poses) = (Vec::new(), Vec::new());
        for (step, x, y, yaw) in steps {
            stamp += step;
            stamps.push(stamp);
            poses.push(Isometry2::new(Vector2::new(x, y), yaw));
        }
        Trajectory::timed(stamps, poses)
    })
}

fn assert_close(a: &Trajectory, b: &Trajectory) {
    assert_eq!(a.len(), b.len());
    for (a, b) in a.poses.iter().zip(&b.poses) {
        assert!((a.translation.vector - b.translation.vector).norm() < 1e-5);
        assert!((a.inverse() * b).rotation.angle().abs() < 1e-9);
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(32))]
    #[test]
    fn written_trajectories_are_read_back(written in trajectory()) {
        let (mut tum, mut kitti) = (Vec::new(), Vec::new());
        write_tum(&written, &mut tum).unwrap();
        write_kitti(&written, &mut kitti).unwrap();
        let from_tum = from_text("a.tum", std::str::from_utf8(&tum).unwrap()).unwrap();
        assert_close(&written, &from_tum);
        prop_assert_eq!(&written.stamp_ns, &from_tum.stamp_ns);
        let from_kitti = from_text("a.txt", std::str::from_utf8(&kitti).unwrap()).unwrap();
        assert_close(&written, &from_kitti);
        prop_assert!(from_kitti.stamp_ns.is_none() && write_tum(&from_kitti, &mut Vec::new()).is_err());
    }
}

const START_US: i64 = 1_630_597_331_000_000;
/// A place in UTM, m.
const CORNER_M: [f64; 3] = [623_422.85, 4_848_820.47, 153.98];

/// Reads poses in space, with roll and pitch.
fn read(text: &str) -> Result<Trajectory, TrajectoryError> {
    from_text("poses.txt", text)
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
