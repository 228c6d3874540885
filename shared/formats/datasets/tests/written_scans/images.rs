//! Images: powers, transposition, corrupt files, sizes; and azimuths that the host has lost, in
//! images whose rows have neither an angle nor a time.

use std::{
    f32::consts::TAU,
    fs,
    path::{Path, PathBuf},
};

use gyre_datasets::{DatasetOptions, Format, LostAzimuthOption, inspect, open, reopen};
use gyre_geometry::{OwnedScan, scan::flag};
use gyre_radar::lost::stale_rows;

use super::{folder, opened, options};
use crate::common::{
    PERIOD_US, START_US, Sweep, assert_refused, write_oxford, write_png, write_radiate,
    write_sweeps,
};

fn assert_powers(scan: &OwnedScan) {
    for row in 0..40 {
        let mut powers = scan.view().row(row).iter().enumerate();
        assert!(powers.all(|(bin, power)| *power == Sweep::power(row, bin)));
    }
}

#[test]
fn written_powers_are_read_back() {
    let root = folder();
    write_oxford(root.path(), 3);
    let mut dataset = opened(root.path());
    assert_eq!((dataset.format(), dataset.len()), (Format::Oxford, 3));
    let scan = dataset.scan(2).unwrap();
    assert_powers(&scan);
    for row in 0..40 {
        assert!((scan.azimuth_rad[row] - (13 + 140 * row) as f32 / 5600.0 * TAU).abs() < 1e-6);
    }
    let middle_us = START_US + 2 * PERIOD_US + 39 * PERIOD_US / 40 / 2;
    assert_eq!(scan.geometry.stamp_ns, middle_us * 1000);
}

#[test]
fn only_files_are_listed_and_links_to_them() {
    let root = folder();
    let files = write_oxford(root.path(), 3);
    let name = |us: i64, extension: &str| {
        let name = format!("radar/{}.{extension}", START_US - us);
        root.path().join(name)
    };
    fs::create_dir(name(1, "png")).unwrap();
    fs::write(name(2, "txt"), "").unwrap();
    std::os::unix::fs::symlink("nowhere", name(3, "png")).unwrap();
    std::os::unix::fs::symlink(&files[1], name(4, "PNG")).unwrap();
    let dataset = opened(root.path());
    let listed = (0..dataset.len()).map(|index| dataset.file(index));
    let listed: Vec<_> = listed.collect();
    let expected = [&name(4, "PNG"), &files[0], &files[1], &files[2]];
    assert_eq!(listed, expected);
}

#[test]
fn a_dataset_that_is_opened_again_has_the_scans_that_it_had() {
    for write in [write_oxford, write_radiate] {
        let root = folder();
        let files = write(root.path(), 4);
        let dataset = opened(root.path());
        let (format, listed) = (dataset.format(), dataset.files().to_vec());
        let none = DatasetOptions::default();
        fs::rename(&files[1], files[1].with_file_name("000000.png")).unwrap();
        let mut again = reopen(root.path(), &none, format, listed).unwrap();
        assert_eq!((again.len(), again.period_ns()), (4, dataset.period_ns()));
        assert_eq!(again.nominal_stamp_ns(1), dataset.nominal_stamp_ns(1));
        assert!(again.scan(1).unwrap_err().is_io());
        let [now, then] = [again, dataset].map(|mut dataset| dataset.scan(2).unwrap());
        assert_eq!((now.bytes, now.stamp_ns), (then.bytes, then.stamp_ns));
    }
}

#[test]
fn a_radar_with_another_encoder_and_period_needs_options_only() {
    let root = folder();
    let turn_us = 1_000_000;
    let write = |start, row_interval| {
        let sweep = Sweep {
            rows: 120,
            bins: 162,
            first_count: 0,
            step: 30,
            row_interval,
            ..Sweep::at(start)
        };
        sweep.write(&root.path().join(format!("radar/{start}.png")));
    };
    for k in 0..3 {
        write(START_US + k * turn_us, turn_us / 120);
    }
    fs::write(root.path().join("radar.timestamps"), "").unwrap();
    let options = DatasetOptions {
        range_resolution_m: Some(0.6),
        range_offset_m: Some(3.0),
        encoder_counts: Some(3600),
        ..DatasetOptions::default()
    };
    let mut dataset = open(root.path(), &options).unwrap();
    let scan = dataset.scan(1).unwrap();
    assert_eq!((scan.geometry.azimuths, scan.geometry.bins), (120, 162));
    assert!((scan.view().range_m(161.0) - 99.9).abs() < 1e-3);
    assert!((scan.azimuth_rad[90] - 0.75 * TAU).abs() < 1e-6);
    write(START_US, 3 * turn_us / 120);
    assert_refused(dataset.scan(0), "not one sweep of at most 2.000 s");
    let scan_ns = scan.geometry.stamp_ns;
    assert!((scan_ns - dataset.nominal_stamp_ns(1).unwrap()).abs() < 1_000_000);
    let middle_us = START_US + turn_us + 119 * (turn_us / 120) / 2;
    assert_eq!(scan_ns / 1000, middle_us);
}

#[test]
fn transposed_powers_are_transposed_back() {
    let root = folder();
    write_radiate(root.path(), 4);
    let mut dataset = opened(root.path());
    let scan = dataset.scan(3).unwrap();
    let geometry = scan.geometry;
    assert_eq!((geometry.azimuths, geometry.bins), (40, 60));
    assert_eq!(geometry.range_resolution_m, 100.0 / 60.0);
    assert_powers(&scan);
    assert_eq!(scan.stamp_ns[0], 1_549_986_607_003_000_000 + 750_000_000);
}

#[test]
fn a_corrupt_image_in_the_middle_leaves_the_others_readable() {
    let root = folder();
    let files = write_oxford(root.path(), 7);
    let whole = fs::read(&files[1]).unwrap();
    fs::write(&files[1], &whole[..whole.len() / 2]).unwrap();
    write_png(&files[2], 40, 71, &[0; 40 * 71]);
    let write = |edit: fn(&mut Sweep), file| {
        let mut sweep = Sweep::default();
        edit(&mut sweep);
        sweep.write(file);
    };
    write(|sweep| sweep.rows = 39, &files[3]);
    fs::write(&files[4], b"not an image").unwrap();
    fs::write(&files[5], b"").unwrap();
    let mut dataset = opened(root.path());
    let mut refused = |index, words: &str| {
        assert_refused(dataset.scan(index), words);
    };
    refused(1, "is truncated after");
    let rotated = "40 columns x 71 rows, but most images of the dataset are 71 columns x 40 rows: it is rotated by 90 degrees";
    refused(2, rotated);
    refused(4, "is not a PNG image");
    refused(5, "is truncated after 0 bytes");
    refused(7, "scan 7 does not exist: the dataset has 7 scans");
    write(|sweep| sweep.bins = 59, &files[1]);
    refused(1, "70 columns x 40 rows, but most images");
    // The third has lost its last row.
    assert!([0, 3, 6].iter().all(|index| dataset.scan(*index).is_ok()));
}

#[test]
fn images_of_other_content_are_refused_in_plain_words() {
    let root = folder();
    let file = write_oxford(root.path(), 1).remove(0);
    let valid = fs::read(&file).unwrap();
    type Edit = fn(&mut Vec<u8>);
    let edits: [(Edit, &str); 4] = [
        // After the header: length 0, a critical chunk named by four zeros, its checksum.
        (
            |bytes| {
                bytes.splice(33..33, [0, 0, 0, 0, 0, 0, 0, 0, 0x21, 0x44, 0xdf, 0x1c]);
            },
            "Unrecognized critical chunk",
        ),
        (|bytes| bytes[30] ^= 1, "CRC error"),
        (|bytes| bytes[25] = 2, "8-bit colour"),
        // No memory is allocated for it.
        (
            |bytes| bytes[16..24].copy_from_slice(&[0x7f, 0xff, 0xff, 0xff].repeat(2)),
            "is too large for a radar scan",
        ),
    ];
    for (edit, words) in edits {
        let mut bytes = valid.clone();
        edit(&mut bytes);
        fs::write(&file, bytes).unwrap();
        let scan = open(root.path(), &DatasetOptions::default())
            .map_err(|error| error.to_string())
            .and_then(|mut dataset| dataset.scan(0).map_err(|error| error.to_string()));
        let error = scan.err().unwrap_or_default();
        assert!(error.contains(words), "{error}");
        assert!(!error.contains(['{', '\0']), "{error}");
    }
}

#[test]
fn the_first_images_count_once_among_the_sizes() {
    let root = folder();
    write_sweeps(&root.path().join("navtech"), 20, |k, sweep| {
        sweep.bins = if k < 8 { 30 } else { 60 };
    });
    assert_eq!(opened(root.path()).image_size().width, 71);
}

const AZIMUTHS: usize = 40;
const BINS: usize = 60;
const SCANS: usize = 5;
/// Azimuths that each scan has lost.
const LOST: [usize; SCANS] = [0, 2, 2, 0, 1];

/// Powers that no other scan and azimuth has.
fn power(scan: usize, azimuth: usize, bin: usize) -> u8 {
    let number = (scan * AZIMUTHS + azimuth) * BINS + bin;
    ((number as u64 + 1).wrapping_mul(0x9E37_79B9_7F4A_7C15) >> 56) as u8
}

/// Transposes images, and replaces their last columns by the last columns of the image before.
fn write_images(paths: &[PathBuf]) {
    let mut before = vec![0; AZIMUTHS * BINS];
    for (scan, path) in paths.iter().enumerate() {
        let mut image: Vec<u8> = (0..AZIMUTHS * BINS)
            .map(|pixel| power(scan, pixel % AZIMUTHS, pixel / AZIMUTHS))
            .collect();
        let rows = image.chunks_mut(AZIMUTHS).zip(before.chunks(AZIMUTHS));
        for (row, before) in rows {
            let measured = AZIMUTHS - LOST[scan];
            row[measured..].copy_from_slice(&before[measured..]);
        }
        write_png(path, AZIMUTHS, BINS, &image);
        before = image;
    }
}

fn mulran_images(root: &Path) -> Vec<PathBuf> {
    let folder = root.join("sensor_data/radar/polar");
    let end_us = |scan| START_US + scan as i64 * PERIOD_US;
    let image = |scan| folder.join(format!("{}.png", end_us(scan) * 1000));
    (0..SCANS).map(image).collect()
}

#[test]
fn stale_columns_are_counted_in_all_images_without_metadata() {
    for format in [Format::Radiate, Format::Mulran] {
        let root = folder();
        let images = match format {
            Format::Radiate => write_radiate(root.path(), SCANS as i64),
            _ => mulran_images(root.path()),
        };
        write_images(&images);
        let mut dataset = opened(root.path());
        assert_eq!(dataset.format(), format);
        // In any order: the last columns of scan 1 equal the last columns of scan 0.
        for index in [0, 1, 2, 3, 4, 1, 0, 2] {
            let lost = LOST[index];
            let scan = dataset.scan(index).unwrap();
            assert_eq!(stale_rows(&scan.view()), lost, "{format} {index}");
            let (measured, stale) = scan.flags.split_at(AZIMUTHS - lost);
            let all = |flags: &[u8], expected| flags.iter().all(|flags| *flags == expected);
            assert!(all(measured, flag::MEASURED | flag::ASSUMED));
            assert!(all(stale, flag::STALE | flag::ASSUMED));
        }
        let report = inspect(root.path(), &DatasetOptions::default()).unwrap();
        let findings = report.findings.join(" ");
        let sentence = "3 of 5 scans have lost azimuths, 5 in all";
        assert!(findings.contains(sentence), "{findings}");

        let ignoring = options(|o| o.lost_azimuths = Some(LostAzimuthOption::Ignore));
        let mut dataset = open(root.path(), &ignoring).unwrap();
        let scan = dataset.scan(2).unwrap();
        assert!(scan.flags.iter().all(|flags| *flags == flag::MEASURED));
    }
}
