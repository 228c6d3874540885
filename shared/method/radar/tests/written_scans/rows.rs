//! The rows of a sweep: encoders, validity, chirps.

use std::f32::consts::TAU;

use gyre_radar::scan::flag;
use gyre_radar::{AzimuthSource, DatasetOptions, Format, ReadError, open};

use super::{first_scan, folder};
use crate::common::{START_US, Sweep, read, write_oxford, write_png};

#[test]
fn rows_that_are_not_one_sweep_are_rejected() {
    let cases: [(Sweep, &str); 5] = [
        (
            Sweep {
                step: 0,
                ..Sweep::default()
            },
            "azimuth does not increase",
        ),
        (
            Sweep {
                step: 5500,
                ..Sweep::default()
            },
            "azimuth does not increase",
        ),
        (
            Sweep {
                start: 1_000,
                ..Sweep::default()
            },
            "years 2015 to 2040",
        ),
        (
            Sweep {
                start: 2_300_000_000_000_000,
                ..Sweep::default()
            },
            "years 2015 to 2040",
        ),
        (
            Sweep {
                row_interval: 10_000_000,
                ..Sweep::default()
            },
            "not one sweep",
        ),
    ];
    for (sweep, words) in cases {
        let root = folder();
        let files = write_oxford(root.path(), 1);
        sweep.write(&files[0]);
        let error = first_scan(root.path()).unwrap_err().to_string();
        assert!(error.contains(words), "{error}");
    }
}

#[test]
fn an_encoder_of_another_size_is_reported_and_can_be_configured() {
    let root = folder();
    let files = write_oxford(root.path(), 1);
    let sweep = Sweep::default();
    let mut pixels = sweep.pixels();
    for row in 0..40 {
        pixels[row * sweep.width() + 8..][..2].copy_from_slice(&(row as u16 * 410).to_le_bytes());
    }
    write_png(&files[0], sweep.width(), 40, &pixels);
    let error = first_scan(root.path()).unwrap_err();
    assert!(
        matches!(
            error,
            ReadError::EncoderCount {
                row: 14,
                count: 5740,
                counts: 5600,
                ..
            }
        ),
        "{error}"
    );
    let options = DatasetOptions {
        encoder_counts: Some(16400),
        ..DatasetOptions::default()
    };
    let scan = read(open(root.path(), &options).unwrap().as_mut(), 0).unwrap();
    assert!((scan.azimuth_rad[10] - 0.25 * TAU).abs() < 1e-6);
    let options = DatasetOptions {
        azimuth_source: Some(AzimuthSource::Uniform),
        ..DatasetOptions::default()
    };
    let scan = read(open(root.path(), &options).unwrap().as_mut(), 0).unwrap();
    assert!((scan.azimuth_rad[10] - 0.25 * TAU).abs() < 1e-6);
}

#[test]
fn byte_ten_is_validity_in_oxford_and_unused_in_boreas() {
    let root = folder();
    let sweep = Sweep {
        byte_ten: |row| if row == 5 { 0 } else { 255 },
        ..Sweep::default()
    };
    sweep.write(&root.path().join(format!("radar/{START_US}.png")));
    for (format, expected) in [(Format::Oxford, 0), (Format::Boreas, flag::MEASURED)] {
        let options = DatasetOptions {
            format: Some(format),
            ..DatasetOptions::default()
        };
        let scan = read(open(root.path(), &options).unwrap().as_mut(), 0).unwrap();
        assert_eq!(
            (scan.flags[4], scan.flags[5]),
            (flag::MEASURED, expected),
            "{format}"
        );
    }
}

#[test]
fn alternating_chirps_are_not_invalid_rows() {
    let root = folder();
    let sweep = Sweep {
        byte_ten: |row| if row % 2 == 0 { 255 } else { 0 },
        ..Sweep::default()
    };
    sweep.write(&root.path().join(format!("radar/{START_US}.png")));
    let options = DatasetOptions {
        format: Some(Format::Oxford),
        ..DatasetOptions::default()
    };
    let scan = read(open(root.path(), &options).unwrap().as_mut(), 0).unwrap();
    assert!(
        scan.flags
            .iter()
            .all(|f| f & flag::MEASURED != 0 && f & flag::CHIRP_KNOWN != 0)
    );
    assert_eq!(
        (
            scan.flags[0] & flag::CHIRP_UP,
            scan.flags[1] & flag::CHIRP_UP
        ),
        (flag::CHIRP_UP, 0)
    );
}
