//! Same bytes: a row for each pair of a configuration and a fault. A fault disturbs a `gyre run` at
//! random moments. The run finishes with the results of the undisturbed one, or ends with one
//! sentence and the same command resumes to them.
//!
//! A row prints its seed. `GYRE_FAULTS_SEED` repeats a seed; `GYRE_FAULTS_EVENTS` is the number of
//! faults of each row, with one seed after the other:
//!
//! ```sh
//! GYRE_FAULTS_EVENTS=20 cargo test --release -p gyre --test pipeline -- \
//!     --ignored faults::nightly::radiate
//! ```

pub mod configurations;
mod input;
mod kills;
mod limits;
mod results;
mod scene;
pub mod tools;

use std::env;

use configurations::Configuration;
use scene::Scene;

/// Attempts at a fault that comes too late, because the run is over.
const ATTEMPTS: usize = 20;

/// A kind of faults: it runs a configuration, disturbs the run, and judges its results; `None` if
/// the run ended before the fault.
type Fault = fn(&mut Scene) -> Option<()>;

/// Faults by name, as the rows have them.
mod kinds {
    pub use super::{input::*, kills::*, limits::*, results::*};
}

/// A test for each fault of each configuration.
macro_rules! rows {
    ($attributes:tt $($configuration:ident: $($fault:ident)*;)*) => {
        $(mod $configuration {
            $(row! { $attributes $configuration $fault })*
        })*
    };
}

macro_rules! row {
    ({$($attribute:tt)*} $configuration:ident $fault:ident) => {
        #[test]
        $($attribute)*
        fn $fault() {
            use crate::restart::faults::{configurations, kinds, strike};
            strike(&configurations::$configuration(), kinds::$fault);
        }
    };
}

rows! {
    {}
    plain: each_process_is_killed processes_are_killed_in_storms a_process_is_killed_as_it_starts
        a_process_is_killed_again_and_again the_supervisor_is_killed the_run_is_interrupted
        the_run_is_interrupted_as_it_starts the_recording_has_gaps the_recording_vanishes;
    slam: each_process_is_killed a_process_is_killed_as_it_writes processes_are_killed_in_storms
        the_supervisor_is_killed the_supervisor_is_killed_as_it_writes_results the_disk_is_full
        files_may_not_grow the_results_are_read_only the_results_vanish
        memory_runs_out descriptors_run_out;
    loops: each_process_is_killed;
    gap: each_process_is_killed;
    unreadable: each_process_is_killed;
    lost_azimuths: each_process_is_killed a_process_is_killed_again_and_again;
    standstill: a_process_is_killed_again_and_again;
    joint_search: each_process_is_killed;
    gyro_and_wheels: each_process_is_killed the_supervisor_is_killed;
    doppler: the_supervisor_is_killed;
    network_of_two_scans: each_process_is_killed processes_are_killed_in_storms
        a_process_is_killed_again_and_again;
    network_at_an_unreadable_scan: each_process_is_killed;
    network_in_rten: each_process_is_killed;
    simulation: each_process_is_killed the_supervisor_is_killed;
    replayed: each_process_is_killed;
    python: each_process_is_killed;
}

mod nightly {
    rows! {
        {#[ignore = ".ci/nightly: more rows"]}
        plain: a_process_is_killed_after_the_last_pose;
        small_map: a_process_is_killed_again_and_again the_supervisor_is_killed;
        gyro_and_wheels: processes_are_killed_in_storms;
        doppler: each_process_is_killed;
        network_of_two_scans: the_supervisor_is_killed;
        objects: a_process_is_killed_again_and_again the_run_is_interrupted;
        gnss: a_process_is_killed_again_and_again;
        loops: a_process_is_killed_as_it_starts a_process_is_killed_as_it_writes
            a_process_is_killed_after_the_last_pose
            processes_are_killed_in_storms the_supervisor_is_killed
            the_supervisor_is_killed_as_it_writes_results the_run_is_interrupted the_disk_is_full
            files_may_not_grow the_results_are_read_only the_results_vanish
            the_recording_has_gaps the_recording_vanishes memory_runs_out
            descriptors_run_out;
        radiate: each_process_is_killed a_process_is_killed_as_it_starts
            a_process_is_killed_as_it_writes
            processes_are_killed_in_storms the_supervisor_is_killed
            the_supervisor_is_killed_as_it_writes_results the_run_is_interrupted the_disk_is_full
            files_may_not_grow the_results_are_read_only the_results_vanish
            the_recording_has_gaps the_recording_vanishes memory_runs_out
            descriptors_run_out;
    }
}

fn number(variable: &str) -> Option<u64> {
    let set = env::var(variable).ok()?;
    let number = set.parse();
    Some(number.unwrap_or_else(|_| panic!("{variable} is {set}, but must be a number")))
}

/// Strikes a run of the configuration, where the machine can do that.
fn strike(configuration: &Configuration, fault: Fault) {
    if !configuration.is_possible() {
        return;
    }
    let first = number("GYRE_FAULTS_SEED").unwrap_or_else(|| rand::random::<u16>().into());
    for seed in first..first + number("GYRE_FAULTS_EVENTS").unwrap_or(1) {
        println!("GYRE_FAULTS_SEED={seed}");
        let mut scene = Scene::new(configuration, seed);
        (0..ATTEMPTS)
            .find_map(|_| fault(&mut scene))
            .unwrap_or_else(|| panic!("{ATTEMPTS} runs ended before the fault"));
    }
}
