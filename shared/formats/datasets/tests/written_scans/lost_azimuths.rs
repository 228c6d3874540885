//! Azimuths that the host has lost, in images whose rows have neither an angle nor a time.

use std::path::{Path, PathBuf};

use gyre_datasets::{DatasetOptions, Format, LostAzimuthOption, inspect, open};
use gyre_geometry::scan::flag;
use gyre_radar::lost::stale_rows;

use super::{folder, opened, options};
use crate::common::{PERIOD_US, START_US, read, write_png, write_radiate};

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
            let scan = read(dataset.as_mut(), index).unwrap();
            assert_eq!(stale_rows(&scan.view()), lost, "{format} {index}");
            let (measured, stale) = scan.flags.split_at(AZIMUTHS - lost);
            let all = |flags: &[u8], expected| flags.iter().all(|flags| *flags == expected);
            assert!(all(measured, flag::MEASURED | flag::ASSUMED));
            assert!(all(stale, flag::STALE | flag::ASSUMED));
        }
        let report = inspect(root.path(), &DatasetOptions::default(), None).unwrap();
        let findings = report.findings.join(" ");
        let sentence = "3 of 5 scans have lost azimuths, 5 in all";
        assert!(findings.contains(sentence), "{findings}");

        let ignoring = options(|o| o.lost_azimuths = Some(LostAzimuthOption::Ignore));
        let mut dataset = open(root.path(), &ignoring).unwrap();
        let scan = read(dataset.as_mut(), 2).unwrap();
        assert!(scan.flags.iter().all(|flags| *flags == flag::MEASURED));
    }
}
