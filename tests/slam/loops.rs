//! Results of a run with SLAM: a drive that comes back to its start is corrected by loops.

use std::sync::Arc;

use gyre_geometry::xy_yaw;
use gyre_slam::estimation::G2o;

use crate::{
    common::{Ended, Run, Shared, script},
    reach::{only_if, python_has},
};

/// Once around a block.
fn run(kind: &str) -> Run {
    Run::of_recorded_demo().set(&format!("slam.kind={kind}"))
}

/// The same by a graph, complete.
fn corrected() -> Arc<Run> {
    static RUN: Shared<Run> = Shared::new();
    RUN.get(|| {
        let run = run("graph");
        run.complete();
        run
    })
}

#[test]
fn a_drive_that_comes_back_is_corrected_by_loops() {
    let filtered = run("filter");
    filtered.complete();
    for (kind, run) in [("graph", &*corrected()), ("filter", &filtered)] {
        let summary = run.summary();
        let figure = |place: &str| summary.pointer(place).and_then(|it| it.as_f64()).unwrap();
        let used = figure("/slam/loops_used");
        assert!(used >= 1.0, "{kind}");
        assert!(figure("/slam/ate_m") < 0.3, "{kind}");
        let loops = run.result("loops.csv");
        let rows = loops.lines().filter(|row| row.ends_with(",used"));
        assert_eq!(rows.count() as f64, used);
        let graph = G2o::parse(&run.result("graph.g2o")).unwrap();
        assert_eq!(graph.poses.len() as f64, figure("/slam/keyframes"));
        let odometry = graph.poses.len() - 1;
        assert_eq!((graph.constraints.len() - odometry) as f64, used);
        let stamps = |name| {
            let text = run.result(name);
            let stamp = |row: &str| row.split(' ').next().map(str::to_owned);
            text.lines().map(stamp).collect::<Vec<_>>()
        };
        assert_eq!(stamps("trajectory_slam.tum"), stamps("trajectory.tum"));
    }
}

/// GTSAM's reading of the graph of a run: edges, poses, the last pose, and by how much poses are
/// from its optimum at most, m.
pub fn by_gtsam(run: &Run) -> [f64; 6] {
    let mut command = script("slam/g2o.py");
    command.arg(run.out().join("graph.g2o"));
    let read = Ended::of(command);
    read.succeeded();
    let numbers = read.stdout.split_whitespace();
    let numbers: Vec<f64> = numbers.map(|number| number.parse().unwrap()).collect();
    numbers.try_into().unwrap()
}

#[test]
fn gtsam_reads_all_of_a_graph_and_its_optimum_has_the_same_poses() {
    only_if!(python_has("gtsam"));
    let run = corrected();
    let [edges, poses, x, y, yaw, apart_m] = by_gtsam(&run);
    let graph = G2o::parse(&run.result("graph.g2o")).unwrap();
    let counts = [graph.constraints.len(), graph.poses.len()];
    assert_eq!([edges, poses], counts.map(|count| count as f64));
    let expected = xy_yaw(&graph.poses[graph.poses.len() - 1]);
    for (read, expected) in [x, y, yaw].iter().zip(expected) {
        assert!((read - expected).abs() < 1e-9, "{read} for {expected}");
    }
    assert!(apart_m < 0.02, "{apart_m}");
}
