//! Files of pose graphs.

use std::f64::consts::FRAC_PI_2;

use super::common::{Drive, ODOMETRY};
use gyre_geometry::{Pose, pose, xy_yaw};
use gyre_slam::estimation::{G2o, G2oError, Kind, PoseGraph};
use nalgebra::{Matrix3, Vector3};

#[test]
fn a_file_written_comes_back() {
    let mut drive = Drive::new(40, 20, ODOMETRY, 1);
    let closing = drive.close(30, 10);
    let mut graph = PoseGraph::new(Pose::identity(), Default::default());
    for constraint in drive.odometry.iter().chain([&closing]) {
        graph.apply(constraint).unwrap();
    }
    graph.solve().unwrap();
    let text = G2o::write(graph.poses(), graph.constraints());
    let back = G2o::parse(&text).unwrap();
    for (a, b) in graph.poses().iter().zip(&back.poses) {
        assert_eq!(xy_yaw(a), xy_yaw(b));
    }
    assert_eq!(back.constraints.len(), 40);
    for (a, b) in graph.constraints().zip(&back.constraints) {
        assert_eq!((a.from, a.to, a.kind), (b.from, b.to, b.kind));
        assert!((a.motion.covariance - b.motion.covariance).norm() < 1e-12);
    }
}

/// GTSAM 4.3 reads edges up to the first unknown line, and reports nothing.
#[test]
fn no_line_that_gtsam_does_not_know_is_before_an_edge() {
    let drive = Drive::new(40, 20, ODOMETRY, 1);
    let poses = vec![Pose::identity(); 40];
    let text = G2o::write(&poses, drive.odometry.iter().copied());
    let is_known = |line: &&str| line.starts_with("VERTEX_SE2 ") || line.starts_with("EDGE_SE2 ");
    let read: Vec<&str> = text.lines().take_while(is_known).collect();
    let edges = read.iter().filter(|line| line.starts_with("EDGE_SE2 "));
    assert_eq!((edges.count(), read.len()), (39, 79));
    let rest: Vec<&str> = text.lines().skip(79).collect();
    assert_eq!(rest, ["FIX 0"]);
}

#[test]
fn the_information_of_an_edge_lies_along_the_axes_of_its_end() {
    // A left turn: along the axes of the end, x is certain to 0.1 m and y to 0.2 m; along the axes
    // of the start it is the other way round.
    let text = "VERTEX_SE2 0 0 0 0\nVERTEX_SE2 1 2 1 1.5707963267948966\n\
                EDGE_SE2 0 1 2 1 1.5707963267948966 100 0 0 25 0 400\n";
    let read = G2o::parse(text).unwrap().constraints[0];
    let expected = Matrix3::from_diagonal(&Vector3::new(0.04, 0.01, 0.0025));
    assert!((read.motion.covariance - expected).norm() < 1e-15);
    assert_eq!(read.kind, Kind::Odometry);
    let written = G2o::write(&[Pose::identity(), pose(2.0, 1.0, FRAC_PI_2)], [read]);
    let again = G2o::parse(&written).unwrap().constraints[0];
    assert!((again.motion.covariance - expected).norm() < 1e-15);
}

#[test]
fn files_that_are_no_plane_pose_graph_are_refused_with_line_and_reason() {
    let vertices = "VERTEX_SE2 0 0 0 0\nVERTEX_SE2 1 1 0 0\nVERTEX_SE2 2 2 0 0\n";
    for (line, reason) in [
        (
            "VERTEX_SE3:QUAT 3 0",
            "line 4: \"VERTEX_SE3:QUAT\" is not read",
        ),
        (
            "VERTEX_SE2 3 0 0",
            "line 4: VERTEX_SE2 needs an id, x, y and yaw",
        ),
        ("VERTEX_SE2 3 0 0 nan", "line 4: VERTEX_SE2 needs an id"),
        (
            "VERTEX_SE2 1 0 0 0",
            "line 4: vertex 1 is in the place of vertex 3",
        ),
        (
            "EDGE_SE2 0 9 1 0 0 1 0 0 1 0 1",
            "line 4: vertex 9 is not in the file",
        ),
        (
            "EDGE_SE2 0 1 1 0 0 0 0 0 1 0 1",
            "line 4: the information matrix of the edge from 0 to 1",
        ),
        (
            "EDGE_SE2 0 1 1 0 0 1 0 0 1 0",
            "line 4: EDGE_SE2 needs two ids",
        ),
        (
            "EDGE_SE2 0 1 1 0 0 1 0 0 1 0 1",
            "there is no edge from vertex 1 to the next one, 2",
        ),
        (
            "# fixes 1: of another file",
            "line 4: 0 edges that are no odometry are before \"1\" fixes",
        ),
    ] {
        let error: G2oError = G2o::parse(&format!("{vertices}{line}\n")).unwrap_err();
        assert!(error.to_string().starts_with(reason), "{error}");
    }
}
