//! Power failures: every change that a run makes to its folder is recorded, and after any of them
//! the power fails. Whatever the synchronisations allow to survive, the next run gives the bytes of
//! the undisturbed one or refuses in a sentence.
//!
//! The next run depends on the state of the disk alone, so each state is tried once, however many
//! power failures lead to it. Half of them lead to one that was tried: a synchronisation makes no
//! new state, and a change that does not survive makes none either.
//!
//! `GYRE_POWER_FAILURES=N` tries N random outcomes at each change instead of one.

mod disk;
mod machine;

use std::{
    collections::HashSet,
    hash::{DefaultHasher, Hash, Hasher},
    path::{Path, PathBuf},
};

use gyre_slam::SlamKind;
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

/// Power failures of one machine, and what followed them.
struct Failures<'a> {
    machine: &'a Machine,
    /// Hashes of the states that were tried.
    tried: HashSet<u64>,
    outcomes: Outcomes,
}

/// Counts of states.
#[derive(Debug, Default)]
struct Outcomes {
    complete: usize,
    refused: usize,
    /// Power failures that left a state that had been tried.
    again: usize,
}

impl<'a> Failures<'a> {
    fn of(machine: &'a Machine) -> Self {
        Self {
            machine,
            tried: HashSet::new(),
            outcomes: Outcomes::default(),
        }
    }

    /// Lets the next run follow a power failure that left `state`.
    fn check(&mut self, state: &State, case: &str) {
        let mut hasher = DefaultHasher::new();
        state.hash(&mut hasher);
        if !self.tried.insert(hasher.finish()) {
            self.outcomes.again += 1;
            return;
        }
        let folder = folder();
        state.write(folder.path());
        self.check_next_run(folder.path(), case);
    }

    fn check_next_run(&mut self, out: &Path, case: &str) {
        let machine = self.machine;
        if machine.is_complete(out) {
            assert_eq!(
                machine.results(out),
                machine.undisturbed(),
                "marked as complete: {case}"
            );
        }
        match machine.run(out) {
            Ok(()) => {
                assert_eq!(machine.results(out), machine.undisturbed(), "{case}");
                self.outcomes.complete += 1;
            }
            Err(refusal) => {
                let sentence = refusal.to_string();
                assert!(
                    sentence.contains("--out") || sentence.contains("--fresh"),
                    "{case}: {sentence}"
                );
                eprintln!("{case}: {sentence}");
                self.outcomes.refused += 1;
            }
        }
    }

    /// Checks that no run was refused: a power failure alone damages nothing that was safe.
    fn assert_none_refused(&self) {
        println!("{:?}", self.outcomes);
        assert_eq!(self.outcomes.refused, 0);
    }
}

fn tries() -> u64 {
    let asked = std::env::var("GYRE_POWER_FAILURES").ok();
    asked.and_then(|tries| tries.parse().ok()).unwrap_or(1)
}

#[test]
#[ignore = ".ci/nightly: power fails thousands of times"]
fn after_a_power_failure_at_any_change_the_results_are_the_undisturbed_ones() {
    fails_at_any_change(&Machine::new(SlamKind::None));
}

#[test]
#[ignore = ".ci/nightly: power fails thousands of times"]
fn after_a_power_failure_at_any_change_of_a_run_with_slam_its_keyframes_are_the_undisturbed_ones() {
    fails_at_any_change(&Machine::new(SlamKind::Graph));
}

fn fails_at_any_change(machine: &Machine) {
    let first = folder();
    let root: PathBuf = first.path().canonicalize().unwrap();
    let operations = recorded(machine, &root);
    let (mut disk, mut failures) = (Disk::default(), Failures::of(machine));
    let ways = [Survives::Nothing, Survives::All].into_iter();
    let ways: Vec<_> = ways.chain((0..tries()).map(|_| Survives::Some)).collect();
    for (at, operation) in operations.iter().enumerate() {
        disk.apply(operation);
        for (k, survives) in ways.iter().enumerate() {
            let seed = (at * 1000 + k) as u64;
            let state = disk.fail(*survives, &mut StdRng::seed_from_u64(seed), &root);
            failures.check(&state, &format!("change {at}, {survives:?}, seed {seed}"));
        }
    }
    failures.assert_none_refused();
    // Each change but a synchronisation makes a state that was not there before.
    assert!(failures.outcomes.complete > operations.len());
}

#[test]
#[ignore = ".ci/nightly: power fails thousands of times"]
fn a_second_power_failure_while_the_run_goes_on_changes_nothing_either() {
    fails_twice(&Machine::new(SlamKind::None), 13);
}

#[test]
#[ignore = ".ci/nightly: power fails thousands of times"]
fn a_second_power_failure_while_a_run_with_slam_goes_on_changes_nothing_either() {
    fails_twice(&Machine::new(SlamKind::Graph), 29);
}

/// The power fails at each change that is a multiple of `every`, and at any change of the next run.
fn fails_twice(machine: &Machine, every: usize) {
    let first = folder();
    let root: PathBuf = first.path().canonicalize().unwrap();
    let operations = recorded(machine, &root);
    let (mut disk, mut failures) = (Disk::default(), Failures::of(machine));
    for (at, operation) in operations.iter().enumerate() {
        disk.apply(operation);
        if at % every != 0 {
            continue;
        }
        let failed = folder();
        let mut random = StdRng::seed_from_u64(at as u64);
        disk.fail(Survives::Some, &mut random, &root)
            .write(failed.path());
        let root = failed.path().canonicalize().unwrap();
        let mut disk = Disk::of(&root);
        for (again, operation) in recorded(machine, &root).iter().enumerate() {
            disk.apply(operation);
            for survives in [Survives::Nothing, Survives::Some] {
                let state = disk.fail(survives, &mut random, &root);
                failures.check(&state, &format!("changes {at} and {again}, {survives:?}"));
            }
        }
    }
    failures.assert_none_refused();
}

#[test]
#[ignore = ".ci/nightly: power fails thousands of times"]
fn a_power_failure_while_a_new_run_takes_the_place_of_a_complete_one_mixes_nothing() {
    let (machine, first) = (Machine::new(SlamKind::Graph), folder());
    let root: PathBuf = first.path().canonicalize().unwrap();
    machine.run(&root).unwrap();
    let mut disk = Disk::of(&root);
    let (mut random, mut failures) = (StdRng::seed_from_u64(7), Failures::of(&machine));
    for (at, operation) in recorded(&machine, &root).iter().enumerate() {
        disk.apply(operation);
        for survives in [Survives::Nothing, Survives::All, Survives::Some] {
            let state = disk.fail(survives, &mut random, &root);
            failures.check(&state, &format!("change {at} of the new run, {survives:?}"));
        }
    }
    failures.assert_none_refused();
}
