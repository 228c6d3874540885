//! The rows of a sweep: encoders, validity, chirps.

use std::f32::consts::TAU;

use gyre_datasets::{AzimuthSource, Format, open};
use gyre_geometry::scan::flag;

use super::{first_scan, first_scan_with, folder, options};
use crate::common::{PERIOD_US, START_US, Sweep, assert_refused, write_oxford, write_sweeps};

#[test]
fn rows_that_are_not_one_sweep_are_rejected() {
    type Edit = fn(&mut Sweep);
    let cases: [(Edit, &str); 4] = [
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
        open(root.path(), &options).unwrap().scan(0)
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

#[test]
fn the_size_of_an_encoder_is_that_with_which_a_turn_is_a_turn() {
    for (counts, step, first_count) in [
        (2800, 70, 5),
        (5595, 140, 5),
        (5600, 140, 139),
        (16_000, 400, 399),
    ] {
        let root = folder();
        // The last step is shorter than the others where the counts are no multiple.
        let rows = counts / usize::from(step) + usize::from(counts % usize::from(step) > 0);
        let images = root.path().join("navtech");
        write_sweeps(&images, 3, |_, sweep| {
            (sweep.rows, sweep.step, sweep.counts) = (rows, step, counts);
            sweep.first_count = first_count;
            sweep.row_interval = PERIOD_US / rows as i64;
        });
        for format in [Format::Boreas, Format::Fomo, Format::Oxford] {
            let mut dataset = open(&images, &options(|o| o.format = Some(format))).unwrap();
            let taken = if counts == 5595 { 5600 } else { counts };
            assert_eq!(dataset.encoder_counts(), Some(taken as u16), "{format}");
            let notes = dataset.notes().join(" ");
            let said = notes.contains(&format!("{taken} counts per turn, not 5600"));
            assert_eq!(said, taken != 5600, "{format}: {notes}");
            let scan = dataset.scan(1).unwrap();
            for row in [0, 10] {
                let expected = f32::from(first_count + row * step) / taken as f32 * TAU;
                let found = scan.azimuth_rad[usize::from(row)];
                assert!((found - expected).abs() < 1e-6, "{format} {counts}");
            }
        }
    }
}
