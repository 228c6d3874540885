//! Faults into real processes: each kind disturbs a `gyre run` in one way, and says how the run may
//! end. A run finishes with the results of the undisturbed one, or ends with a sentence and the
//! same command resumes to them, or is refused with a sentence.
//!
//! One fault of each kind, on a short simulated drive, belongs to the tests of every change, unless
//! another test has that fault too. All of them, on a real drive with refinement and learned masks:
//!
//! ```sh
//! cargo test --release -p gyre --test pipeline on_a_real_drive -- --ignored --nocapture
//! ```
//!
//! All runs are with SLAM, so a stage is a follower too, and what must be the same are the
//! corrected trajectory and its loops as well.
//!
//! `GYRE_FAULTS_KIND` selects one kind by its name, `GYRE_FAULTS_SEED` the first seed,
//! `GYRE_FAULTS_EVENTS` the number of faults of each kind. So a fault is repeated by its kind, its
//! seed and 1. The short drive takes the first two as well.

mod drive;
mod environment;
mod input;
mod kills;
mod limits;
mod programs;
mod results;
mod scene;
mod stops;
mod table;
mod tools;
mod watch;

use std::{
    env,
    io::{self, Write},
    panic::{self, AssertUnwindSafe},
    sync::OnceLock,
};

use drive::Drive;
use scene::{Outcome, Scene};
use table::Table;
use tools::Need;

/// Faults of each kind on the real drive.
const EVENTS: u64 = 20;
/// Attempts at a fault that comes too late, because the run is over.
const ATTEMPTS: usize = 20;

/// A kind of faults.
struct Kind {
    name: &'static str,
    /// The requirements on the machine.
    needs: &'static [Need],
    /// Runs a drive, disturbs it, and judges how it ended; `None` if it ended before the fault.
    strike: fn(&mut Scene) -> Option<Outcome>,
}

/// Lists the kinds, with a test each.
macro_rules! kinds {
    ($($(#[$when:meta])* $name:ident: $strike:path, $needs:expr;)*) => {
        const KINDS: &[Kind] = &[$(Kind { name: stringify!($name), needs: &$needs, strike: $strike }),*];

        $(#[test]
        $(#[$when])*
        fn $name() {
            one_on_the_short_drive(stringify!($name));
        })*
    };
}

kinds! {
    #[ignore = "nightly: restart::killed_stages has this fault too"]
    a_stage_is_killed: kills::stage, [];
    #[ignore = "nightly: restart::killed_stages has this fault too"]
    stages_are_killed_together: kills::several, [];
    #[ignore = "nightly: restart::killed_stages has this fault too"]
    a_stage_is_killed_as_it_starts: kills::at_the_start, [];
    a_stage_is_killed_as_it_writes: kills::at_a_write, [];
    processes_are_killed_in_storms: kills::storms, [];
    #[ignore = "nightly: method::pipeline has this fault too"]
    the_supervisor_is_killed: kills::supervisor, [];
    the_supervisor_is_killed_as_it_writes_results: kills::at_the_results, [];
    #[ignore = "nightly: method::pipeline has this fault too"]
    the_run_is_interrupted: kills::interrupt, [];
    #[ignore = "nightly: operate::commands has this fault too"]
    a_process_stops_for_a_while: stops::for_a_while, [];
    #[ignore = "nightly: operate::commands has this fault too"]
    a_stage_stops_for_good: stops::for_good, [];
    the_disk_is_full: results::disk_full, [Need::Mounts];
    input_and_output_fail: results::io_errors, [Need::Fiu];
    files_may_not_grow: results::file_size_limit, [Need::Prlimit];
    the_results_are_read_only: results::read_only, [Need::Mounts, Need::OtherUser];
    the_results_vanish: results::vanish, [];
    #[ignore = "nightly: restart::full_disk has this fault too"]
    nobody_can_be_told: results::full_terminal, [];
    the_recording_has_gaps: input::gaps, [];
    the_recording_vanishes: input::vanishes, [];
    the_clock_is_set: environment::clock_step, [Need::Faketime];
    #[ignore = "nightly: restart::shared_memory has this fault too"]
    shared_memory_fills_up: environment::shared_memory_full, [Need::Mounts];
    memory_runs_out: limits::memory, [Need::Prlimit];
    descriptors_run_out: limits::descriptors, [Need::Prlimit];
    #[ignore = "nightly: restart::supervisor has this fault too"]
    no_process_can_be_started: limits::processes, [Need::Prlimit, Need::OtherUser];
    #[ignore = "nightly: restart::identity has this fault too"]
    the_program_is_replaced: programs::replaced, [];
    #[ignore = "nightly: restart::results has this fault too"]
    a_second_run_has_the_same_results: programs::second_run, [Need::Mounts];
}

/// Prints past the capture of the tests' output, so that what is skipped is seen.
fn say(line: &str) {
    let _ = writeln!(io::stderr(), "{line}");
}

fn number(variable: &str, default: u64) -> u64 {
    let set = env::var(variable).ok();
    set.map_or(default, |text| {
        text.parse()
            .unwrap_or_else(|_| panic!("{variable} is {text}: not a number"))
    })
}

fn selected(kind: &Kind) -> bool {
    env::var("GYRE_FAULTS_KIND").map_or(true, |name| name == kind.name)
}

fn lacking(kind: &Kind) -> Option<&'static str> {
    let lacking = kind.needs.iter().find_map(|need| need.lacking());
    if let Some(reason) = lacking {
        say(&format!("skipped: {}: {reason}", kind.name));
    }
    lacking
}

fn strike(kind: &Kind, drive: &Drive, seed: u64) -> Outcome {
    let mut scene = Scene::new(drive, seed);
    (0..ATTEMPTS)
        .find_map(|_| (kind.strike)(&mut scene))
        .unwrap_or_else(|| panic!("{ATTEMPTS} runs ended before the fault"))
}

fn one_on_the_short_drive(name: &str) {
    static DRIVE: OnceLock<Drive> = OnceLock::new();
    let kind = KINDS.iter().find(|kind| kind.name == name).unwrap();
    if !selected(kind) || lacking(kind).is_some() {
        return;
    }
    let seed = number("GYRE_FAULTS_SEED", 1);
    println!("GYRE_FAULTS_KIND={name} GYRE_FAULTS_SEED={seed}");
    strike(kind, DRIVE.get_or_init(Drive::short), seed);
}

#[test]
#[ignore = "takes an hour; see the head of this file"]
fn all_kinds_on_a_real_drive() {
    if let Some(drive) = Drive::real() {
        all_kinds(&drive);
    }
}

#[test]
#[ignore = "takes a quarter of an hour; see the head of this file"]
fn all_kinds_on_a_drive_with_loops() {
    all_kinds(&Drive::with_loops());
}

fn all_kinds(drive: &Drive) {
    let (first, events) = (
        number("GYRE_FAULTS_SEED", 1),
        number("GYRE_FAULTS_EVENTS", EVENTS),
    );
    say(&format!(
        "GYRE_FAULTS_SEED={first}, {events} faults of each kind"
    ));
    let mut table = Table::default();
    for kind in KINDS.iter().filter(|kind| selected(kind)) {
        if let Some(reason) = lacking(kind) {
            table.skip(kind.name, reason);
            continue;
        }
        for seed in first..first + events {
            println!("\n== {} {seed}", kind.name);
            let struck = panic::catch_unwind(AssertUnwindSafe(|| strike(kind, drive, seed)));
            let outcome = struck.map_err(|_| seed);
            say(&format!("{} {seed}: {}", kind.name, table::word(&outcome)));
            table.add(kind.name, outcome);
        }
    }
    say(&table.to_string());
    assert!(table.findings().is_empty(), "{:#?}", table.findings());
}
