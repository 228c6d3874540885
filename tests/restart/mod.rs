//! Restarts and results: whatever is killed, full or taken away, the results are the undisturbed
//! ones.

mod doppler;
mod faults;
mod full_disk;
mod gyro;
mod identity;
mod killed_stages;
mod objects;
mod power_failure;
mod results;
mod shared_memory;
mod supervisor;

use crate::common::{Run, STAGES, recording};

/// Asserts that a run has the same result whichever stage is killed in it.
fn assert_same_after_kills(run: impl Fn() -> Run, undisturbed: &str) {
    for stage in STAGES {
        let run = run().rate("6");
        let mut running = run.start();
        running.await_poses(recording::SCANS / 3).kill(stage);
        running.finish().succeeded();
        assert_eq!(run.odometry(), undisturbed, "{stage}");
    }
}

/// Asserts that a run has the same result if it is killed as a whole, and continued.
fn assert_same_when_continued(run: impl Fn() -> Run, undisturbed: &str) {
    let run = run().rate("6");
    let mut running = run.start();
    running.await_poses(recording::SCANS / 2);
    running.kill_supervisor();
    run.complete();
    assert_eq!(run.odometry(), undisturbed);
}
