//! Wrong times, and recordings with gaps: a run does not wait for a year, and reports where the
//! chain of motions breaks.

use std::{
    fs,
    path::{Path, PathBuf},
};

use crate::{
    common::{
        Run, odometry,
        recording::{self, MODERATE},
        runtime_is_installed,
    },
    method::{in_process::assert_same_bits, learned_masks::card},
};

/// The scan before which time breaks.
pub const BREAK: usize = 12;
const HOUR_US: i64 = 3_600_000_000;
const YEAR_US: i64 = 8_760 * HOUR_US;

fn run_of(recording: &Path) -> Run {
    Run::small().data(recording)
}

/// A recording with a gap of a year before scan [`BREAK`].
pub fn with_a_gap() -> PathBuf {
    recording::damaged("gap", |images| {
        for image in &images[BREAK..] {
            recording::shift(image, YEAR_US);
        }
    })
}

/// A recording whose clock was set back by an hour before scan [`BREAK`]; its files are numbered.
fn with_a_clock_set_back() -> PathBuf {
    recording::damaged("clock-set-back", |images| {
        for image in &images[BREAK..] {
            recording::restamp(image, |_, us| us - HOUR_US);
        }
        for (number, image) in images.iter().enumerate() {
            fs::rename(image, image.with_file_name(format!("{number:06}.png"))).unwrap();
        }
    })
}

/// Asserts that the chain of motions breaks before scan [`BREAK`] and nowhere else.
fn assert_breaks_once(run: &Run) {
    run.assert_counts("published=24 processed=24 unreadable=0 missing=0 breaks=1");
    let rows = odometry::rows(&run.odometry());
    let scans: Vec<u64> = rows.iter().map(|row| row.scan).collect();
    let expected = (1..recording::SCANS as u64).filter(|scan| *scan != BREAK as u64);
    assert_eq!(scans, expected.collect::<Vec<_>>());
}

#[test]
fn a_gap_of_a_year_and_a_clock_that_was_set_back_break_the_chain_and_nobody_waits() {
    for recording in [with_a_gap(), with_a_clock_set_back()] {
        let fast = run_of(&recording);
        fast.complete();
        assert_breaks_once(&fast);
        let paced = run_of(&recording).rate(MODERATE);
        assert_eq!(paced.complete(), fast.odometry());
    }
}

#[test]
fn a_live_run_over_a_gap_or_a_clock_that_was_set_does_not_take_the_rest_for_missed() {
    for recording in [with_a_gap(), with_a_clock_set_back()] {
        let run = run_of(&recording).rate("2").set("run.mode=live");
        run.complete();
        run.assert_counts("published=24 breaks=1");
        let processed = run.count("processed") as usize;
        assert!(processed > recording::SCANS - BREAK / 2, "{processed}");
    }
}

#[test]
fn the_method_in_one_process_breaks_the_chain_at_the_same_scan() {
    for recording in [with_a_gap(), with_a_clock_set_back()] {
        assert_same_bits(&run_of(&recording));
        if runtime_is_installed() {
            assert_same_bits(&run_of(&recording).masked_by(&card("pair-127")));
        }
    }
}
