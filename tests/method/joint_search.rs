//! The exhaustive search by five processes, joint-search in place of the two halves.

use std::collections::BTreeSet;

use crate::common::{Run, odometry};
use crate::method::refinement::names;

const JOINT: &str = "joint-search";
const STAGES: [&str; 5] = [
    "radar-replay",
    "masking",
    JOINT,
    "refinement",
    "pose-integration",
];
const SCANS: usize = 64;

/// The demo with another search, and nobody who follows it.
fn demo() -> Run {
    Run::of_recorded_demo()
        .set("search.kind=exhaustive")
        .set("slam.kind=none")
}

#[test]
fn five_processes_give_a_trajectory_of_their_own() {
    let run = demo().rate("max");
    let odometry = run.complete();
    let summary = run.summary();
    let rows = odometry::rows(&odometry);
    assert_eq!(rows.len(), SCANS - 1);
    odometry::assert_unbroken(&rows);
    let stages = BTreeSet::from(STAGES.map(str::to_owned));
    assert_eq!(names(&summary["stages"]), stages);
    assert_eq!(names(&summary["latency"]["stages"]), stages);
    assert_eq!(summary["stages"][JOINT]["allocations_after_five"], 0);
    let path = summary["evaluation"]["path_m"].as_f64().unwrap();
    let error = summary["evaluation"]["ate"]["rmse_m"].as_f64().unwrap();
    assert!(
        path > 100.0 && error < 0.02 * path,
        "{error} m over {path} m"
    );
}
