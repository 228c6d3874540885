//! The rows of a sweep: encoders, validity, chirps.

use std::f32::consts::TAU;

use gyre_datasets::{AzimuthSource, Format, open};
use gyre_geometry::scan::flag;

use super::{first_scan, first_scan_with, folder, options};
use crate::common::{START_US, Sweep, assert_refused, read, write_oxford};

#[test]
fn rows_that_are_not_one_sweep_are_rejected() {
    type Edit = fn(&mut Sweep);
    let cases: [(Edit, &str); 5] = [
        (|s| s.step = 0, "azimuth does not increase"),
        (|s| s.step = 5500, "azimuth does not increase"),
        (|s| s.start = 1_000, "years 2015 to 2040"),
        (|s| s.start = 2_300_000_000_000_000, "years 2015 to 2040"),
        (|s| s.row_interval = 10_000_000, "not one sweep"),
    ];
    for (edit, words) in cases {
        let mut sweep = Sweep::default();
        edit(&mut sweep);
        let root = folder();
        let files = write_oxford(root.path(), 1);
        sweep.write(&files[0]);
        assert_refused(first_scan(root.path()), words);
    }
}

#[test]
fn an_encoder_of_another_size_than_configured_is_reported() {
    let root = folder();
    let files = write_oxford(root.path(), 1);
    let sweep = Sweep {
        first_count: 0,
        step: 410,
        counts: 16_400,
        ..Sweep::default()
    };
    sweep.write(&files[0]);
    let configured = |counts| {
        let options = options(|o| o.encoder_counts = Some(counts));
        read(open(root.path(), &options).unwrap().as_mut(), 0)
    };
    for (counts, words) in [
        (
            5600,
            "row 14: encoder count 5740 exceeds 5600 counts per turn",
        ),
        (
            25_000,
            "130 degrees of the turn, for an encoder of 25000 counts",
        ),
    ] {
        assert_refused(configured(counts), words);
    }
    let scan = configured(16_400).unwrap();
    assert!((scan.azimuth_rad[10] - 0.25 * TAU).abs() < 1e-6);
    let scan = first_scan_with(root.path(), |o| {
        o.azimuth_source = Some(AzimuthSource::Uniform)
    });
    assert!((scan.azimuth_rad[10] - 0.25 * TAU).abs() < 1e-6);
}

#[test]
fn byte_ten_is_validity_in_oxford_unused_in_boreas_and_the_chirps_if_it_alternates() {
    let root = folder();
    let sweep = Sweep {
        byte_ten: |row| if row == 5 { 0 } else { 255 },
        ..Sweep::default()
    };
    sweep.write(&root.path().join(format!("radar/{START_US}.png")));
    for (format, expected) in [(Format::Oxford, 0), (Format::Boreas, flag::MEASURED)] {
        let scan = first_scan_with(root.path(), |o| o.format = Some(format));
        assert_eq!(scan.flags[4..6], [flag::MEASURED, expected], "{format}");
    }
    let sweep = Sweep {
        byte_ten: |row| if row % 2 == 0 { 255 } else { 0 },
        ..Sweep::default()
    };
    sweep.write(&root.path().join(format!("radar/{START_US}.png")));
    let scan = first_scan_with(root.path(), |o| o.format = Some(Format::Oxford));
    let known = flag::MEASURED | flag::CHIRP_KNOWN;
    let mut pairs = scan.flags.chunks(2);
    assert!(pairs.all(|pair| pair == [known | flag::CHIRP_UP, known]));
}
