//! Images: powers, transposition, corrupt files, sizes.

use std::f32::consts::TAU;
use std::fs;

use gyre_datasets::{DatasetOptions, Format, OpenError, ReadError, open, reopen};
use gyre_radar::{OwnedScan, ScanLimits};

use super::{first_scan, folder, opened, rejected};
use crate::common::{PERIOD_US, START_US, Sweep, read, write_oxford, write_png, write_radiate};

#[test]
fn written_powers_are_read_back() {
    let root = folder();
    write_oxford(root.path(), 3);
    let mut dataset = opened(root.path());
    assert_eq!((dataset.format(), dataset.len()), (Format::Oxford, 3));
    let scan = read(dataset.as_mut(), 2).unwrap();
    for row in 0..40 {
        assert!(
            scan.view()
                .row(row)
                .iter()
                .enumerate()
                .all(|(bin, p)| *p == Sweep::power(row, bin))
        );
        assert!((scan.azimuth_rad[row] - (13 + 140 * row) as f32 / 5600.0 * TAU).abs() < 1e-6);
    }
    assert_eq!(
        scan.geometry.stamp_ns,
        (START_US + 2 * PERIOD_US + 39 * PERIOD_US / 40 / 2) * 1000
    );
}

#[test]
fn only_files_are_listed_and_links_to_them() {
    let root = folder();
    let files = write_oxford(root.path(), 3);
    let name = |us: i64, extension: &str| {
        root.path()
            .join(format!("radar/{}.{extension}", START_US - us))
    };
    fs::create_dir(name(1, "png")).unwrap();
    fs::write(name(2, "txt"), "").unwrap();
    std::os::unix::fs::symlink("nowhere", name(3, "png")).unwrap();
    std::os::unix::fs::symlink(&files[1], name(4, "PNG")).unwrap();
    let dataset = opened(root.path());
    let listed: Vec<_> = (0..dataset.len())
        .map(|index| dataset.file(index))
        .collect();
    let expected = [&name(4, "PNG"), &files[0], &files[1], &files[2]];
    assert_eq!(listed, expected);
}

#[test]
fn a_dataset_that_is_opened_again_has_the_scans_that_it_had() {
    for write in [write_oxford, write_radiate] {
        let root = folder();
        let files = write(root.path(), 4);
        let dataset = opened(root.path());
        let (format, listed) = (dataset.format(), dataset.files().clone());
        let none = DatasetOptions::default();
        fs::rename(&files[1], files[1].with_file_name("000000.png")).unwrap();
        let mut again = reopen(root.path(), &none, format, listed).unwrap();
        assert_eq!((again.len(), again.period_ns()), (4, dataset.period_ns()));
        assert_eq!(again.nominal_stamp_ns(1), dataset.nominal_stamp_ns(1));
        assert!(read(again.as_mut(), 1).unwrap_err().is_io());
        let [now, then] = [again, dataset].map(|mut dataset| read(dataset.as_mut(), 2).unwrap());
        assert_eq!((now.bytes, now.stamp_ns), (then.bytes, then.stamp_ns));
    }
}

#[test]
fn a_radar_with_another_encoder_and_period_needs_options_only() {
    let root = folder();
    let turn_us = 1_000_000;
    for start in [START_US, START_US + turn_us, START_US + 2 * turn_us] {
        let sweep = Sweep {
            rows: 120,
            bins: 162,
            first_count: 0,
            step: 30,
            start,
            row_interval: turn_us / 120,
            ..Sweep::default()
        };
        sweep.write(&root.path().join(format!("radar/{start}.png")));
    }
    fs::write(root.path().join("radar.timestamps"), "").unwrap();
    let options = DatasetOptions {
        range_resolution_m: Some(0.6),
        range_offset_m: Some(3.0),
        encoder_counts: Some(3600),
        ..DatasetOptions::default()
    };
    let mut dataset = open(root.path(), &options).unwrap();
    let scan = read(dataset.as_mut(), 1).unwrap();
    assert_eq!((scan.geometry.azimuths, scan.geometry.bins), (120, 162));
    assert!((scan.view().range_m(161.0) - 99.9).abs() < 1e-3);
    assert!((scan.azimuth_rad[90] - 0.75 * TAU).abs() < 1e-6);
    let sweep = Sweep {
        rows: 120,
        bins: 162,
        first_count: 0,
        step: 30,
        start: START_US,
        row_interval: 3 * turn_us / 120,
        ..Sweep::default()
    };
    sweep.write(&root.path().join(format!("radar/{START_US}.png")));
    let error = read(dataset.as_mut(), 0).unwrap_err().to_string();
    assert!(
        error.contains("not one sweep of at most 2.000 s"),
        "{error}"
    );
    assert!((scan.geometry.stamp_ns - dataset.nominal_stamp_ns(1).unwrap()).abs() < 1_000_000);
    assert_eq!(
        scan.geometry.stamp_ns / 1000,
        START_US + turn_us + 119 * (turn_us / 120) / 2
    );
}

#[test]
fn transposed_powers_are_transposed_back() {
    let root = folder();
    write_radiate(root.path(), 4);
    let mut dataset = opened(root.path());
    let scan = read(dataset.as_mut(), 3).unwrap();
    assert_eq!(
        (
            scan.geometry.azimuths,
            scan.geometry.bins,
            scan.geometry.range_resolution_m
        ),
        (40, 60, 100.0 / 60.0)
    );
    for azimuth in 0..40 {
        assert!(
            scan.view()
                .row(azimuth)
                .iter()
                .enumerate()
                .all(|(bin, p)| *p == Sweep::power(azimuth, bin))
        );
    }
    assert_eq!(scan.stamp_ns[0], 1_549_986_607_003_000_000 + 750_000_000);
}

#[test]
fn a_corrupt_image_in_the_middle_leaves_the_others_readable() {
    let root = folder();
    let files = write_oxford(root.path(), 7);
    let whole = fs::read(&files[1]).unwrap();
    fs::write(&files[1], &whole[..whole.len() / 2]).unwrap();
    write_png(&files[2], 40, 71, &[0; 40 * 71]);
    Sweep {
        rows: 39,
        ..Sweep::default()
    }
    .write(&files[3]);
    fs::write(&files[4], b"not an image").unwrap();
    fs::write(&files[5], b"").unwrap();
    let mut dataset = opened(root.path());
    let mut error = |index| read(dataset.as_mut(), index).err();
    assert!(matches!(error(1), Some(ReadError::Truncated { .. })));
    let rotated = error(2).unwrap().to_string();
    assert!(
        rotated.contains("40 columns x 71 rows")
            && rotated.ends_with("it is rotated by 90 degrees"),
        "{rotated}"
    );
    // It has lost its last row.
    assert!(error(3).is_none());
    assert!(matches!(error(4), Some(ReadError::NotPng { .. })));
    assert!(matches!(
        error(5),
        Some(ReadError::Truncated { bytes: 0, .. })
    ));
    assert!(matches!(
        error(7),
        Some(ReadError::NoSuchScan { index: 7, len: 7 })
    ));
    assert!(error(0).is_none() && error(6).is_none());
    Sweep {
        bins: 59,
        ..Sweep::default()
    }
    .write(&files[1]);
    let narrow = read(dataset.as_mut(), 1).unwrap_err().to_string();
    assert!(
        narrow.ends_with(
            "70 columns x 40 rows, but most images of the dataset are 71 columns x 40 rows"
        ),
        "{narrow}"
    );
}

#[test]
fn an_unknown_chunk_is_reported_in_plain_words() {
    let root = folder();
    let file = write_oxford(root.path(), 1).remove(0);
    let valid = fs::read(&file).unwrap();
    let mut bytes = valid.clone();
    // After the header: length 0, a critical chunk named by four zeros, its checksum.
    bytes.splice(33..33, [0, 0, 0, 0, 0, 0, 0, 0, 0x21, 0x44, 0xdf, 0x1c]);
    fs::write(&file, bytes).unwrap();
    let error = first_scan(root.path()).unwrap_err().to_string();
    assert!(error.contains("Unrecognized critical chunk"), "{error}");
    assert!(!error.contains(['{', '\0']), "{error}");
    let mut bytes = valid;
    bytes[30] ^= 1;
    fs::write(&file, bytes).unwrap();
    let error = first_scan(root.path()).unwrap_err().to_string();
    assert!(
        error.contains("CRC error") && !error.contains('{'),
        "{error}"
    );
}

#[test]
fn other_pixels_than_grey_bytes_are_rejected() {
    let root = folder();
    let files = write_oxford(root.path(), 2);
    let file = fs::File::create(&files[1]).unwrap();
    let mut encoder = png::Encoder::new(file, 71, 40);
    encoder.set_color(png::ColorType::Rgb);
    encoder
        .write_header()
        .unwrap()
        .write_image_data(&[0; 71 * 40 * 3])
        .unwrap();
    let error = read(opened(root.path()).as_mut(), 1).unwrap_err();
    assert!(error.to_string().contains("8-bit colour"), "{error}");
}

#[test]
fn an_oversized_header_allocates_no_memory() {
    let root = folder();
    let files = write_oxford(root.path(), 1);
    let mut bytes = fs::read(&files[0]).unwrap();
    bytes[16..24].copy_from_slice(&[0x7f, 0xff, 0xff, 0xff, 0x7f, 0xff, 0xff, 0xff]);
    fs::write(&files[0], bytes).unwrap();
    assert!(matches!(
        rejected(root.path()),
        OpenError::FirstImage(ReadError::TooLarge { .. })
    ));
}

#[test]
fn a_slot_that_is_too_small_is_rejected() {
    let root = folder();
    write_oxford(root.path(), 1);
    write_radiate(&root.path().join("transposed"), 1);
    for path in [root.path().to_owned(), root.path().join("transposed")] {
        let mut dataset = opened(&path);
        let limits = dataset.limits();
        for small in [
            ScanLimits {
                bytes: limits.bytes - 1,
                ..limits
            },
            ScanLimits {
                azimuths: limits.azimuths - 1,
                ..limits
            },
        ] {
            let mut scan = OwnedScan::with_limits(small);
            assert!(
                matches!(
                    dataset.read(0, scan.slot()),
                    Err(ReadError::SlotTooSmall { .. })
                ),
                "{small:?}"
            );
        }
    }
}

#[test]
fn the_first_images_count_once_among_the_sizes() {
    let root = folder();
    for k in 0..20 {
        let start = START_US + k * PERIOD_US;
        let sweep = Sweep {
            bins: if k < 8 { 30 } else { 60 },
            start,
            ..Sweep::default()
        };
        sweep.write(&root.path().join(format!("navtech/{start}.png")));
    }
    assert_eq!(opened(root.path()).image_size().width, 71);
}
