//! Distances between recordings.

use super::*;
use crate::{
    realism::{comparison::compare, subject::Measured},
    report::{Record, record},
};
use serde_json::json;

/// A recording of noise with a wall, brighter by `gain`, whose searches are `errors` off.
fn recording(seed: u64, gain: u8, errors: f64) -> Statistics {
    let noise = noise(seed, 40);
    let wall = |azimuth: usize, bin: usize| (100..104).contains(&bin) && azimuth.is_multiple_of(3);
    let one = scan(AZIMUTHS, BINS, 0, |azimuth, bin| {
        noise[azimuth * BINS + bin] + gain + if wall(azimuth, bin) { 60 } else { 0 }
    });
    let mut statistics = measured([&one]);
    statistics.figures.extend(record(json!({
        "next_correlation": 1.0 - errors,
        "next_unmatched_share": errors,
        "plain/rpe/translation_rmse_m": errors,
        "plain/rpe/rotation_rmse_deg": 2.0 * errors,
        "refined/rpe/translation_rmse_m": errors,
        "refined/rpe/rotation_rmse_deg": 2.0 * errors,
    })));
    statistics
}

fn whole(whole: Statistics) -> Measured {
    Measured {
        whole,
        halves: None,
    }
}

/// The rows of a comparison, and what it says at its end.
fn compared(sim: &Measured, real: &Measured, other: Option<&Measured>) -> (Vec<Record>, String) {
    let table = compare(sim, real, other).unwrap();
    (table.rows, table.legend)
}

fn row<'r>(rows: &'r [Record], statistic: &str) -> &'r Record {
    rows.iter()
        .find(|row| row["statistic"] == statistic)
        .unwrap()
}

#[test]
fn a_recording_is_at_no_distance_from_itself() {
    let (one, other) = (whole(recording(1, 0, 0.1)), whole(recording(2, 30, 0.3)));
    let (rows, verdict) = compared(&one, &one, Some(&other));
    let mut known = 0;
    for row in &rows {
        match row["sim"].is_null() {
            true => assert!(
                row["sim_real"].is_null() && row["closer"].is_null(),
                "{row:?}"
            ),
            false => {
                assert_eq!(
                    (&row["sim_real"], &row["closer"]),
                    (&json!(0.0), &json!(true))
                );
                known += 1;
            }
        }
    }
    assert_eq!(known, 12);
    assert_eq!(verdict.trim(), "closer in 12 of 12");
}

#[test]
fn distances_have_the_units_that_they_name() {
    let (one, other) = (recording(1, 0, 0.1), recording(1, 30, 0.2));
    let (rows, verdict) = compared(&whole(one), &whole(other), None);
    let close = |statistic: &str, kind: &str, expected: f64| {
        let row = row(&rows, statistic);
        let distance = row["sim_real"].as_f64().unwrap();
        assert!(
            (distance - expected).abs() < 1e-4,
            "{statistic}: {distance}, not {expected}"
        );
        assert_eq!(row["distance"], kind);
    };
    close("histogram of power", "Wasserstein, counts", 30.0);
    close("mean power against range", "RMS, counts", 30.0);
    close("correlation length in range", "abs. log ratio", 0.0);
    close("next scan: correlation", "abs. difference", 0.1);
    for statistic in [
        "next scan: returns without counterpart",
        "plain search: translation of a motion",
        "refined search: rotation of a motion",
    ] {
        close(statistic, "abs. log ratio", 2f64.ln());
    }
    assert_eq!(verdict, "");
}

#[test]
fn figures_are_shown_with_their_units() {
    let one = recording(1, 0, 0.1);
    let (rows, _) = compared(&whole(one.clone()), &whole(one), None);
    let shown = |statistic: &str| row(&rows, statistic)["sim"].as_str().unwrap().to_owned();
    assert_eq!(shown("next scan: correlation"), "0.900");
    assert_eq!(shown("next scan: returns without counterpart"), "10.00 %");
    assert_eq!(shown("plain search: translation of a motion"), "0.100 m");
    assert_eq!(shown("refined search: rotation of a motion"), "0.200 deg");
    assert!(shown("share of saturated bins").ends_with(" %"));
    assert!(shown("histogram of power").starts_with("50 %: 2"));
    assert!(shown("mean power against range").starts_with("10 m: 2"));
}

#[test]
fn the_nearer_recording_is_closer_and_what_is_not_known_is_not_judged() {
    let (real, mut near, far) = (
        recording(1, 0, 0.1),
        recording(2, 2, 0.11),
        recording(3, 40, 0.5),
    );
    near.figures.remove("plain/rpe/translation_rmse_m");
    let halves = Some([recording(1, 0, 0.1), recording(1, 1, 0.2)]);
    let real = Measured {
        whole: real,
        halves,
    };
    let (rows, _) = compared(&whole(near), &real, Some(&whole(far)));
    let histogram = row(&rows, "histogram of power");
    assert_eq!(histogram["closer"], true);
    let within = histogram["within_real"].as_f64().unwrap();
    assert!((within - 1.0).abs() < 1e-9, "{within}");
    assert!(histogram["within_other"].is_null());
    let refined = row(&rows, "refined search: translation of a motion");
    assert_eq!(refined["closer"], true);
    let plain = row(&rows, "plain search: translation of a motion");
    for key in ["closer", "sim_real", "sim", "verdict"] {
        assert!(plain[key].is_null(), "{key}");
    }
    assert!(plain["real_other"].is_number());
}

#[test]
fn farther_than_another_but_not_than_halves_of_one_is_chance() {
    let real = Measured {
        whole: recording(1, 0, 0.1),
        halves: Some([recording(1, 0, 0.1), recording(1, 20, 0.1)]),
    };
    let verdict = |gain: u8| {
        let (rows, _) = compared(
            &whole(recording(1, gain, 0.1)),
            &real,
            Some(&whole(recording(1, 5, 0.1))),
        );
        row(&rows, "histogram of power")["verdict"].clone()
    };
    assert_eq!(verdict(4), "closer");
    assert_eq!(verdict(19), "farther, within chance");
    assert_eq!(verdict(21), "farther");
}
