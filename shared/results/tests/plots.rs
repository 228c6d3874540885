//! The SVG documents.

use crate::common::{by_index, drive};
use gyre_geometry::{Pose, pose};
use gyre_results::evaluation::{
    Evaluation,
    plot::{errors_svg, path_svg, trajectory_svg},
};

fn evaluation(n: usize) -> Evaluation {
    let truth = drive(n, 120.0);
    let moved_by = pose(50.0, 20.0, 1.0);
    let estimate: Vec<_> = truth.iter().map(|p| moved_by * p).collect();
    by_index(&estimate, &truth, 10)
}

/// Returns the points of the longest polyline of a colour, in canvas units.
fn polyline(svg: &str, colour: &str) -> Vec<(f64, f64)> {
    let is_one = |l: &&str| l.starts_with("<polyline") && l.contains(colour);
    let lines = svg.lines().filter(is_one);
    let line = lines.max_by_key(|l| l.len()).unwrap();
    let (_, points) = line.split_once("points=\"").unwrap();
    let (points, _) = points.split_once('"').unwrap();
    let point = |p: &str| {
        let (x, y) = p.split_once(',').unwrap();
        (x.parse().unwrap(), y.parse().unwrap())
    };
    points.split_whitespace().map(point).collect()
}

const ESTIMATE: &str = "#0062B2";
const TRUTH: &str = "#787C82";

#[test]
fn axes_are_equal_and_y_points_up() {
    for side in [(30.0, 30.0), (400.0, 3.0), (2.0, 900.0)] {
        let corners = [(0.0, 0.0), (side.0, 0.0), (side.0, side.1)].map(|(x, y)| pose(x, y, 0.0));
        let points = polyline(&path_svg(&corners, 3, 0.0).unwrap(), ESTIMATE);
        let (right, up) = (points[1].0 - points[0].0, points[1].1 - points[2].1);
        let apart = (right / side.0 - up / side.1) * side.0.min(side.1);
        assert!(apart.abs() < 2.5, "{side:?}: {right} {up}");
    }
}

#[test]
fn an_estimate_in_another_frame_is_drawn_over_its_ground_truth() {
    let e = evaluation(200);
    let svg = trajectory_svg(&e.matched).unwrap();
    let (estimate, truth) = (polyline(&svg, ESTIMATE), polyline(&svg, TRUTH));
    assert_eq!(estimate.len(), truth.len());
    for (a, b) in estimate.iter().zip(&truth) {
        assert!((a.0 - b.0).abs() <= 1.0 && (a.1 - b.1).abs() <= 1.0);
    }
    for words in ["SE(2) alignment", "start", "ground truth"] {
        assert!(svg.contains(words), "{words}");
    }
}

#[test]
fn long_paths_have_kitti_errors_and_short_ones_the_relative_pose_error() {
    let long = errors_svg(&evaluation(400)).unwrap();
    assert!(long.contains("segment length (m)") && long.contains("rotation (deg/100 m)"));
    let short = errors_svg(&evaluation(20)).unwrap();
    assert!(short.contains("distance travelled (m)") && short.contains("too short"));
}

#[test]
fn paths_of_any_extent_are_drawn_and_missing_and_invalid_poses_are_errors() {
    assert!(path_svg(&[Pose::identity()], 1, 0.0).is_ok());
    assert!(path_svg(&[Pose::identity(); 9], 9, 0.0).is_ok());
    assert!(path_svg(&[], 0, 0.0).is_err());
    let invalid = path_svg(&[pose(f64::NAN, 0.0, 0.0)], 1, 0.0);
    assert!(invalid.unwrap_err().to_string().contains("pose 0"));
    for extent in [1e-9, 1.0, 1e4, 1e9] {
        let far = [pose(1e9 - extent, -1e9, 0.0), pose(1e9, extent - 1e9, 0.0)];
        assert!(path_svg(&far, 2, 0.0).unwrap().contains("<polyline"));
    }
}
