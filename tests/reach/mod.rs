//! Programs that are not of this build or not on this machine: stages of others, ROS 2, Python,
//! links.

#[cfg(not(feature = "link"))]
mod absent_features;
pub mod conformance;
mod foreign_stages;
#[cfg(feature = "link")]
mod link;
mod package;
mod python_function;
pub mod python_stage;
mod ros2;
mod ros2_driver;
mod ros2_map;
mod ros2_objects;

use crate::common::{Ended, Run, can, finished, odometry, python};

/// Ends a test that cannot run here.
macro_rules! only_if {
    ($can:expr) => {
        if !$can {
            return;
        }
    };
}
pub(crate) use only_if;

/// Asserts that two odometries have the same motions, but for this distance.
pub fn assert_near(own: &str, other: &str, limit_m: f64) {
    let places = |csv| odometry::columns(csv, &["x_m", "y_m"]).concat();
    let (own, other) = (places(own), places(other));
    assert_eq!(own.len(), other.len());
    for (own, other) in own.iter().zip(&other) {
        let apart_m = own.parse::<f64>().unwrap() - other.parse::<f64>().unwrap();
        assert!(apart_m.abs() < limit_m, "{apart_m} m");
    }
}

/// Asks for another program in place of masking in a running run.
pub fn swap_masking(run: &Run, command: &[&str]) -> Ended {
    finished!["swap", "masking", run.out(); command]
}

/// Returns whether the Python of `GYRE_PYTHON`, else `python3`, has these modules; prints why a
/// test is skipped.
pub fn python_has(modules: &str) -> bool {
    can(&[&python(), "-c", &format!("import {modules}")])
}
