//! The readers on real scans.

use std::f32::consts::TAU;
use std::path::Path;

use crate::common::{read, real};
use gyre_datasets::{Dataset, DatasetOptions, Format, open, read_trajectory};
use gyre_radar::lost::stale_rows;
use gyre_radar::scan::flag;
use gyre_radar::{DopplerEstimator, OwnedScan, Sense};

fn opened(folder: &str) -> Option<Box<dyn Dataset>> {
    Some(open(&real(folder)?, &DatasetOptions::default()).unwrap())
}

/// The image as decoded, without a reader.
fn decoded(path: &Path) -> (usize, usize, Vec<u8>) {
    let mut reader = png::Decoder::new(std::io::BufReader::new(std::fs::File::open(path).unwrap()))
        .read_info()
        .unwrap();
    let (width, height) = (reader.info().width as usize, reader.info().height as usize);
    let mut pixels = vec![0; width * height];
    reader.next_frame(&mut pixels).unwrap();
    (width, height, pixels)
}

fn assert_sweep(scan: &OwnedScan) {
    let view = scan.view();
    assert_eq!(view.geometry.sense, Sense::Clockwise);
    assert!(view.azimuth_rad.iter().all(|a| (0.0..TAU).contains(a)));
    assert!(view.azimuth_rad.windows(2).all(|w| w[0] < w[1]));
    assert!(view.stamp_ns.windows(2).all(|w| w[0] < w[1]));
    assert!(
        view.stamp_ns[0] < view.geometry.stamp_ns && view.geometry.stamp_ns < view.stamp_ns[399]
    );
}

#[test]
fn oxford_scans_decode_in_place_with_true_azimuths() {
    let Some(mut oxford) = opened("oxford-2019-01-10-14-36-48") else {
        return;
    };
    assert_eq!(
        (oxford.format(), oxford.len(), oxford.limits().azimuths),
        (Format::Oxford, 11, 400)
    );
    for index in 0..oxford.len() {
        let scan = read(oxford.as_mut(), index).unwrap();
        assert_sweep(&scan);
        let (width, height, pixels) = decoded(oxford.file(index));
        assert_eq!((width, height), (3779, 400));
        assert_eq!(scan.view().row(17), &pixels[17 * 3779 + 11..18 * 3779]);
        assert!((scan.azimuth_rad[0] - 13.0 / 5600.0 * TAU).abs() < 1e-6);
        assert!((scan.azimuth_rad[399] - 5599.0 / 5600.0 * TAU).abs() < 1e-6);
        assert!(scan.flags.iter().all(|f| *f == flag::MEASURED));
        assert_eq!(
            (scan.geometry.range_resolution_m, scan.geometry.bins),
            (0.0438, 3768)
        );
    }
}

#[test]
fn oxford_scan_times_equal_those_of_the_ground_truth() {
    let Some(mut oxford) = opened("oxford-2019-01-10-14-36-48") else {
        return;
    };
    let root = real("oxford-2019-01-10-14-36-48").unwrap();
    let truth = read_trajectory(&root.join("gt/radar_odometry.csv"))
        .unwrap()
        .stamp_ns
        .unwrap();
    for (index, truth) in truth.iter().enumerate() {
        let stamp = read(oxford.as_mut(), index).unwrap().geometry.stamp_ns;
        assert!(
            (stamp - truth).abs() <= 1_000,
            "scan {index}: {stamp} and {truth}"
        );
        let nominal = oxford.nominal_stamp_ns(index).unwrap();
        assert!(
            (nominal - stamp).abs() < 5_000_000,
            "scan {index}: {nominal} and {stamp}"
        );
    }
}

#[test]
fn oxford_row_stamps_are_smooth_and_start_with_the_sweep() {
    let Some(mut oxford) = opened("oxford-2019-01-10-14-36-48") else {
        return;
    };
    let scan = read(oxford.as_mut(), 0).unwrap();
    let intervals: Vec<i64> = scan.stamp_ns.windows(2).map(|w| w[1] - w[0]).collect();
    assert!(
        intervals.iter().all(|i| (600_000..660_000).contains(i)),
        "{intervals:?}"
    );
    let name: i64 = oxford
        .file(0)
        .file_stem()
        .unwrap()
        .to_str()
        .unwrap()
        .parse()
        .unwrap();
    assert!(
        (scan.stamp_ns[0] - name * 1000).abs() < 8_000_000,
        "{}",
        scan.stamp_ns[0] - name * 1000
    );
}

#[test]
fn radiate_images_are_transposed_and_the_clock_is_uniform() {
    let Some(mut radiate) = opened("radiate-2019-02-12") else {
        return;
    };
    assert_eq!(
        (radiate.format(), radiate.len(), radiate.is_transposed()),
        (Format::Radiate, 466, true)
    );
    let mut stamps = Vec::new();
    for index in [0, 100, 330, 465] {
        let scan = read(radiate.as_mut(), index).unwrap();
        assert_sweep(&scan);
        let (width, height, pixels) = decoded(radiate.file(index));
        assert_eq!((width, height, scan.geometry.bins), (400, 576, 576));
        for azimuth in [0, 1, 63, 64, 399] {
            let column: Vec<u8> = (0..576).map(|row| pixels[row * 400 + azimuth]).collect();
            assert_eq!(scan.view().row(azimuth), &column[..]);
        }
        assert_eq!(scan.geometry.range_resolution_m, 100.0 / 576.0);
        assert_eq!(
            radiate.nominal_stamp_ns(index),
            Some(scan.geometry.stamp_ns)
        );
        stamps.push((index as f64, scan.geometry.stamp_ns));
    }
    // Reference clock: 1549986607.7092834 s + k * 0.25002 s, and the mean of 400 columns.
    for (index, stamp) in stamps {
        let reference = 0.7092834 + index * 0.25002 + 0.25002 * 399.0 / 800.0;
        let found = (stamp - 1_549_986_607_000_000_000) as f64 * 1e-9;
        assert!(
            (found - reference).abs() < 2e-3,
            "scan {index}: {found} and {reference}"
        );
    }
}

#[test]
fn lost_azimuths_of_images_without_metadata_are_counted() {
    // Scans, those with losses, and azimuths that were lost, as a script that
    // was written before this reader counts them.
    for (folder, expected) in [
        ("radiate-2019-02-12", [466, 214, 286]),
        ("radiate-2019-02-12-b", [409, 196, 263]),
        ("radiate-2019-02-12-standing", [112, 68, 100]),
        ("radiate-tiny_foggy", [18, 0, 0]),
        ("samples/mulran-kaist03-raw", [2, 0, 0]),
    ] {
        let Some(mut scans) = opened(folder) else {
            return;
        };
        let counts: Vec<usize> = (0..scans.len())
            .map(|index| stale_rows(&read(scans.as_mut(), index).unwrap().view()))
            .collect();
        let lossy = counts.iter().filter(|count| **count > 0).count();
        let found = [counts.len(), lossy, counts.iter().sum()];
        assert_eq!(found, expected, "{folder}");
        // Whichever scan is read first.
        for index in [counts.len() - 1, counts.len() / 2, 0] {
            let scan = read(scans.as_mut(), index).unwrap();
            assert_eq!(stale_rows(&scan.view()), counts[index], "{folder} {index}");
        }
    }
}

#[test]
fn no_radiate_scan_is_received_before_its_sweep_starts() {
    for folder in ["radiate-2019-02-12", "radiate-tiny_foggy"] {
        let Some(mut radiate) = opened(folder) else {
            return;
        };
        let mut touching = 0;
        for index in 0..radiate.len() {
            let start = read(radiate.as_mut(), index).unwrap().stamp_ns[0];
            let late = radiate.logged_stamp_ns(index).unwrap() - start;
            assert!(late >= -10, "{folder}, scan {index}: {late} ns");
            touching += usize::from(late < 10);
        }
        assert_eq!(touching, 2, "{folder}");
    }
}

#[test]
fn boreas_rt_is_detected_by_its_chirps() {
    let Some(mut scans) = opened("samples/boreas-rt-2024-12-03") else {
        return;
    };
    assert_eq!((scans.format(), scans.len()), (Format::BoreasRt, 1));
    let scan = read(scans.as_mut(), 0).unwrap();
    assert_sweep(&scan);
    // Its name is no time.
    let nominal_ns = scans.nominal_stamp_ns(0).unwrap();
    assert!(
        (nominal_ns - scan.geometry.stamp_ns).abs() < 1_000_000,
        "{nominal_ns}"
    );
    assert_eq!(
        (
            scan.geometry.range_resolution_m,
            scan.geometry.range_offset_m
        ),
        (0.04381, -0.31)
    );
    assert_eq!(
        (scan.geometry.bins, scan.geometry.stamp_ns),
        (6848, scan.stamp_ns[199])
    );
    let up = flag::MEASURED | flag::CHIRP_KNOWN | flag::CHIRP_UP;
    for (row, flags) in scan.flags.iter().enumerate() {
        assert_eq!(
            *flags,
            if row % 2 == 1 {
                up
            } else {
                flag::MEASURED | flag::CHIRP_KNOWN
            }
        );
    }
    assert!((scan.azimuth_rad[0] - 7.0 / 5600.0 * TAU).abs() < 1e-6);
}

#[test]
fn fomo_is_detected_by_its_name_and_keeps_all_rows() {
    let Some(mut scans) = opened("samples/fomo-2025-10-14") else {
        return;
    };
    assert_eq!(
        (scans.format(), scans.len(), scans.encoder_counts()),
        (Format::Fomo, 1, Some(5600))
    );
    let scan = read(scans.as_mut(), 0).unwrap();
    assert_sweep(&scan);
    assert!(scan.flags.iter().all(|f| *f == flag::MEASURED));
    assert_eq!(
        (
            scan.geometry.range_resolution_m,
            scan.geometry.range_offset_m
        ),
        (0.0438, -0.32)
    );
    assert!((scan.azimuth_rad[0] - 7.0 / 5600.0 * TAU).abs() < 1e-6);
    let nominal = scans.nominal_stamp_ns(0).unwrap();
    assert!(
        (nominal - scan.geometry.stamp_ns).abs() < 1_000_000,
        "{nominal}"
    );
}

#[test]
fn both_forms_of_mulran_have_the_same_azimuths_and_times() {
    let (Some(mut rows), Some(mut raw)) = (
        opened("samples/mulran-kaist03"),
        opened("samples/mulran-kaist03-raw"),
    ) else {
        return;
    };
    assert_eq!(
        (rows.format(), raw.format()),
        (Format::MulranOxfordForm, Format::Mulran)
    );
    for index in 0..raw.len() {
        let (one, other) = (
            read(rows.as_mut(), index).unwrap(),
            read(raw.as_mut(), index).unwrap(),
        );
        assert_sweep(&one);
        for row in 0..400 {
            assert_eq!(one.view().row(row), other.view().row(row));
            assert!((one.azimuth_rad[row] - other.azimuth_rad[row]).abs() < 1e-6);
            assert!((one.stamp_ns[row] - other.stamp_ns[row]).abs() < 1_000_000);
        }
        let apart_ns = one.geometry.stamp_ns - other.geometry.stamp_ns;
        assert!(apart_ns.abs() < 1_000_000, "{apart_ns} ns");
    }
}

/// The third scan of the sample is two seconds after the second.
#[test]
fn a_gap_moves_no_scan_of_a_short_recording() {
    let Some(mut scans) = opened("samples/mulran-kaist03") else {
        return;
    };
    assert!(
        (scans.period_ns() - 249_600_000).abs() < 100_000,
        "{}",
        scans.period_ns()
    );
    for index in 0..scans.len() {
        let stamp_ns = read(scans.as_mut(), index).unwrap().geometry.stamp_ns;
        let apart_ns = scans.nominal_stamp_ns(index).unwrap() - stamp_ns;
        assert!(apart_ns.abs() < 1_000_000, "scan {index}: {apart_ns} ns");
    }
}

/// The truth is not known. The correlations of both chirps, at zero in all directions, show that
/// the vehicle stands.
#[test]
fn a_scan_of_boreas_rt_says_that_its_vehicle_stands() {
    let Some(folder) = real("samples/boreas-rt-2024-12-03") else {
        return;
    };
    let options = DatasetOptions {
        doppler_s: Some(0.049),
        ..DatasetOptions::default()
    };
    let scan = read(open(&folder, &options).unwrap().as_mut(), 0).unwrap();
    let found = DopplerEstimator::default().estimate(&scan.view(), 5.0);
    let found = found.unwrap();
    let [ahead, left] = found.velocity_mps;
    assert!(ahead.hypot(left) < 0.5, "{found:?}");
    let [xx, _, yy] = found.covariance;
    assert!(xx.max(yy) < 0.04 && found.bearings > 100, "{found:?}");
}
