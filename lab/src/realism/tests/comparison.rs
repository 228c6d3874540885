//! Distances between recordings.

use super::*;
use crate::realism::{
    change::Change,
    comparison::compare,
    recording::{Measured, Recording},
};
use crate::sequence::Figures;

/// A recording of noise with a wall, brighter by `gain`, whose searches are `errors` off.
fn recording(seed: u64, gain: u8, errors: f64) -> Recording {
    let noise = noise(seed, 40);
    let wall = |azimuth: usize, bin: usize| (100..104).contains(&bin) && azimuth.is_multiple_of(3);
    let one = scan(AZIMUTHS, BINS, 0, |azimuth, bin| {
        noise[azimuth * BINS + bin] + gain + if wall(azimuth, bin) { 60 } else { 0 }
    });
    let change = Change {
        pairs: 9,
        correlation: 1.0 - errors,
        unmatched_share: errors,
    };
    let errors = Figures::from([
        ("rpe/translation_rmse_m", errors),
        ("rpe/rotation_rmse_deg", 2.0 * errors),
    ]);
    let mut statistics = measured([&one]);
    statistics.change = Some(change);
    Recording {
        name: format!("number {seed}"),
        statistics,
        plain: errors.clone(),
        refined: errors,
        aligned_by_truth: 0,
        aligned_by_odometry: 0,
    }
}

fn whole(recording: Recording) -> Measured {
    Measured {
        whole: recording,
        halves: None,
    }
}

#[test]
fn a_recording_is_at_no_distance_from_itself() {
    let (one, other) = (whole(recording(1, 0, 0.1)), whole(recording(2, 30, 0.3)));
    let comparison = compare(&one, &one, Some(&other));
    for row in &comparison.rows {
        let known = row.values[0].is_some();
        assert_eq!(row.sim_real, known.then_some(0.0), "{}", row.statistic);
    }
    assert_eq!(
        comparison.judged,
        comparison
            .rows
            .iter()
            .filter(|row| row.values[0].is_some())
            .count()
    );
    let not_closer: Vec<&str> = comparison
        .rows
        .iter()
        .filter(|row| row.closer == Some(false))
        .map(|row| row.statistic)
        .collect();
    assert!(not_closer.is_empty(), "{not_closer:?}");
}

#[test]
fn distances_have_the_units_that_they_name() {
    let (one, other) = (recording(1, 0, 0.1), recording(1, 30, 0.2));
    let comparison = compare(&whole(one), &whole(other), None);
    let distance = |name: &str| {
        comparison
            .rows
            .iter()
            .find(|row| row.statistic == name)
            .unwrap()
            .sim_real
            .unwrap()
    };
    let close = |name: &str, expected: f64| {
        assert!(
            (distance(name) - expected).abs() < 1e-4,
            "{name}: {}, not {expected}",
            distance(name)
        );
    };
    close("histogram of power", 30.0);
    close("mean power against range", 30.0);
    close("correlation length in range", 0.0);
    close("next scan: correlation", 0.1);
    close("next scan: returns without counterpart", 2f64.ln());
    close("plain search: translation of a motion", 2f64.ln());
    close("refined search: rotation of a motion", 2f64.ln());
    assert_eq!((comparison.judged, comparison.closer), (0, 0));
}

#[test]
fn the_nearer_recording_is_closer_and_what_is_not_known_is_not_judged() {
    let (real, mut near, far) = (
        recording(1, 0, 0.1),
        recording(2, 2, 0.11),
        recording(3, 40, 0.5),
    );
    near.plain.clear();
    let halves = Some([recording(1, 0, 0.1), recording(1, 1, 0.2)]);
    let real = Measured {
        whole: real,
        halves,
    };
    let comparison = compare(&whole(near), &real, Some(&whole(far)));
    let row = |name: &str| {
        comparison
            .rows
            .iter()
            .find(|row| row.statistic == name)
            .unwrap()
    };
    assert_eq!(row("histogram of power").closer, Some(true));
    let within = row("histogram of power").within_real.unwrap();
    assert!(
        (within - 1.0).abs() < 1e-9 && row("histogram of power").within_other.is_none(),
        "{within}"
    );
    assert!(
        !row("histogram of power").is_within_chance()
            && row("next scan: correlation").is_within_chance()
    );
    assert_eq!(
        row("refined search: translation of a motion").closer,
        Some(true)
    );
    let plain = row("plain search: translation of a motion");
    assert_eq!(
        (plain.closer, plain.sim_real, &plain.values[0]),
        (None, None, &None)
    );
    assert!(plain.real_other.is_some());
}
