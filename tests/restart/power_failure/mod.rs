//! Power failures: after any change that a run makes to its folder, the power fails. Whatever the
//! synchronisations allow to survive, the next run gives the bytes of the undisturbed one; it
//! depends on the disk alone, so each state is tried once. `GYRE_POWER_FAILURES=N` tries N random
//! outcomes at each change instead of one.

mod disk;
mod machine;

use std::{
    collections::HashSet,
    hash::{DefaultHasher, Hash, Hasher},
    path::{Path, PathBuf},
};

use gyre_storage::record::{Operation, Recorder};
use rand::{SeedableRng, rngs::StdRng};
use tempfile::TempDir;

use disk::{Disk, State, Survives};
use machine::Machine;

/// A folder in memory, where a synchronisation costs nothing.
fn folder() -> TempDir {
    tempfile::Builder::new()
        .prefix("gyre-power-")
        .tempdir_in("/dev/shm")
        .or_else(|_| tempfile::tempdir())
        .unwrap()
}

/// Runs to the end and returns the changes that this has made.
fn recorded(machine: &Machine, out: &Path) -> Vec<Operation> {
    let out = out.canonicalize().unwrap();
    let recorder = Recorder::start(&out);
    machine.run(&out).unwrap();
    recorder.operations()
}

/// Lets the next run follow a power failure that left `state`: a power failure alone damages
/// nothing that was safe, so no run is refused.
fn check(machine: &Machine, tried: &mut HashSet<u64>, state: &State, case: &str) {
    let mut hasher = DefaultHasher::new();
    state.hash(&mut hasher);
    if !tried.insert(hasher.finish()) {
        return;
    }
    let folder = folder();
    let out = folder.path();
    state.write(out);
    let has_undisturbed = || machine.results(out) == machine.undisturbed();
    if machine.is_complete(out) {
        assert!(has_undisturbed(), "marked as complete: {case}");
    }
    let run = machine.run(out);
    run.unwrap_or_else(|refusal| panic!("{case}: {refusal}"));
    assert!(has_undisturbed(), "{case}");
}

fn tries() -> usize {
    let asked = std::env::var("GYRE_POWER_FAILURES").ok();
    asked.and_then(|tries| tries.parse().ok()).unwrap_or(1)
}

/// Lets the power fail after each of these changes of a run. Returns the number of states.
fn fail_at_any(
    machine: &Machine,
    disk: &mut Disk,
    root: &Path,
    operations: &[Operation],
    ways: &[Survives],
    seed: u64,
) -> usize {
    let (mut random, mut tried) = (StdRng::seed_from_u64(seed), HashSet::new());
    for (at, operation) in operations.iter().enumerate() {
        disk.apply(operation);
        for survives in ways {
            let state = disk.fail(*survives, &mut random, root);
            let case = format!("change {at}, {survives:?}, seed {seed}");
            check(machine, &mut tried, &state, &case);
        }
    }
    tried.len()
}

#[test]
#[ignore = ".ci/nightly: power fails thousands of times"]
fn after_a_power_failure_at_any_change_the_results_are_the_undisturbed_ones() {
    let mut ways = vec![Survives::Nothing, Survives::All];
    ways.resize(2 + tries(), Survives::Some);
    for slam in ["none", "graph"] {
        let (machine, first) = (Machine::new(slam), folder());
        let root: PathBuf = first.path().canonicalize().unwrap();
        let operations = recorded(&machine, &root);
        let mut disk = Disk::default();
        let states = fail_at_any(&machine, &mut disk, &root, &operations, &ways, 1);
        // Each change but a synchronisation makes a state that was not there before.
        assert!(states > operations.len(), "{states}");
    }
}

#[test]
#[ignore = ".ci/nightly: power fails thousands of times"]
fn a_second_power_failure_while_the_run_goes_on_changes_nothing_either() {
    for (slam, every) in [("none", 13), ("graph", 29)] {
        let (machine, first) = (Machine::new(slam), folder());
        let root: PathBuf = first.path().canonicalize().unwrap();
        let mut disk = Disk::default();
        for (at, operation) in recorded(&machine, &root).iter().enumerate() {
            disk.apply(operation);
            if at % every != 0 {
                continue;
            }
            let failed = folder();
            let mut random = StdRng::seed_from_u64(at as u64);
            disk.fail(Survives::Some, &mut random, &root)
                .write(failed.path());
            let root = failed.path().canonicalize().unwrap();
            let mut next = Disk::of(&root);
            let operations = recorded(&machine, &root);
            let ways = [Survives::Nothing, Survives::Some];
            fail_at_any(&machine, &mut next, &root, &operations, &ways, at as u64);
        }
    }
}

#[test]
#[ignore = ".ci/nightly: power fails thousands of times"]
fn a_power_failure_while_a_new_run_takes_the_place_of_a_complete_one_mixes_nothing() {
    let (machine, first) = (Machine::new("graph"), folder());
    let root: PathBuf = first.path().canonicalize().unwrap();
    machine.run(&root).unwrap();
    let mut disk = Disk::of(&root);
    let operations = recorded(&machine, &root);
    let ways = [Survives::Nothing, Survives::All, Survives::Some];
    fail_at_any(&machine, &mut disk, &root, &operations, &ways, 7);
}
