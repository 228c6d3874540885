//! The readers on real scans.

use std::{f32::consts::TAU, path::Path};

use gyre_datasets::{Dataset, DatasetOptions, Format, open, read_trajectory};
use gyre_geometry::{OwnedScan, Sense, scan::flag};
use gyre_radar::{DopplerEstimator, lost::stale_rows};

use crate::common::real;

fn opened(folder: &str) -> Option<Box<dyn Dataset>> {
    Some(open(&real(folder)?, &DatasetOptions::default()).unwrap())
}

/// The image as decoded, without a reader.
fn decoded(path: &Path) -> (usize, usize, Vec<u8>) {
    let file = std::io::BufReader::new(std::fs::File::open(path).unwrap());
    let mut reader = png::Decoder::new(file).read_info().unwrap();
    let (width, height) = (reader.info().width as usize, reader.info().height as usize);
    let mut pixels = vec![0; width * height];
    reader.next_frame(&mut pixels).unwrap();
    (width, height, pixels)
}

/// Asserts that a scan is one sweep, and that its time is known without decoding.
fn assert_sweep(dataset: &dyn Dataset, index: usize, scan: &OwnedScan, within_ns: i64) {
    let view = scan.view();
    assert_eq!(view.geometry.sense, Sense::Clockwise);
    assert!(view.azimuth_rad.iter().all(|a| (0.0..TAU).contains(a)));
    assert!(view.azimuth_rad.windows(2).all(|w| w[0] < w[1]));
    assert!(view.stamp_ns.windows(2).all(|w| w[0] < w[1]));
    let scan_ns = view.geometry.stamp_ns;
    assert!(view.stamp_ns[0] < scan_ns && scan_ns < view.stamp_ns[399]);
    let apart_ns = dataset.nominal_stamp_ns(index).unwrap() - scan_ns;
    assert!(apart_ns.abs() <= within_ns, "scan {index}: {apart_ns} ns");
}

#[test]
fn oxford_scans_decode_in_place_with_true_azimuths_and_the_times_of_the_ground_truth() {
    let Some(mut oxford) = opened("oxford-2019-01-10-14-36-48") else {
        return;
    };
    assert_eq!(oxford.format(), Format::Oxford);
    assert_eq!((oxford.len(), oxford.limits().azimuths), (11, 400));
    let root = real("oxford-2019-01-10-14-36-48").unwrap();
    let truth = read_trajectory(&root.join("gt/radar_odometry.csv")).unwrap();
    for (index, truth_ns) in truth.stamp_ns.unwrap().into_iter().enumerate() {
        let scan = oxford.scan(index).unwrap();
        assert_sweep(oxford.as_ref(), index, &scan, 5_000_000);
        let (width, height, pixels) = decoded(oxford.file(index));
        assert_eq!((width, height), (3779, 400));
        assert_eq!(scan.view().row(17), &pixels[17 * 3779 + 11..18 * 3779]);
        assert!((scan.azimuth_rad[0] - 13.0 / 5600.0 * TAU).abs() < 1e-6);
        assert!((scan.azimuth_rad[399] - 5599.0 / 5600.0 * TAU).abs() < 1e-6);
        assert!(scan.flags.iter().all(|f| *f == flag::MEASURED));
        let geometry = scan.geometry;
        assert_eq!((geometry.range_resolution_m, geometry.bins), (0.0438, 3768));
        assert!(
            (geometry.stamp_ns - truth_ns).abs() <= 1_000,
            "scan {index}"
        );
        // The stamps of the rows are smooth, and start with the sweep.
        let mut steps = scan.stamp_ns.windows(2).map(|w| w[1] - w[0]);
        assert!(index > 0 || steps.all(|ns| (600_000..660_000).contains(&ns)));
        let name = oxford.file(index).file_stem().unwrap().to_str().unwrap();
        let apart_ns = scan.stamp_ns[0] - name.parse::<i64>().unwrap() * 1000;
        assert!(index > 0 || apart_ns.abs() < 8_000_000, "{apart_ns}");
    }
}

#[test]
fn radiate_images_are_transposed_and_the_clock_is_uniform() {
    let Some(mut radiate) = opened("radiate-2019-02-12") else {
        return;
    };
    assert_eq!((radiate.format(), radiate.len()), (Format::Radiate, 466));
    assert!(radiate.is_transposed());
    for index in [0, 100, 330, 465] {
        let scan = radiate.scan(index).unwrap();
        assert_sweep(radiate.as_ref(), index, &scan, 0);
        let (width, height, pixels) = decoded(radiate.file(index));
        assert_eq!((width, height, scan.geometry.bins), (400, 576, 576));
        for azimuth in [0, 1, 63, 64, 399] {
            let column: Vec<u8> = (0..576).map(|row| pixels[row * 400 + azimuth]).collect();
            assert_eq!(scan.view().row(azimuth), &column[..]);
        }
        assert_eq!(scan.geometry.range_resolution_m, 100.0 / 576.0);
        // Reference clock: 1549986607.7092834 s + k * 0.25002 s, and the mean of 400 columns.
        let reference = 0.7092834 + index as f64 * 0.25002 + 0.25002 * 399.0 / 800.0;
        let found = (scan.geometry.stamp_ns - 1_549_986_607_000_000_000) as f64 * 1e-9;
        assert!(
            (found - reference).abs() < 2e-3,
            "{index}: {found} and {reference}"
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
        let mut stale = |index| stale_rows(&scans.scan(index).unwrap().view());
        let counts: Vec<usize> = (0..expected[0]).map(&mut stale).collect();
        // Whichever scan is read first.
        for index in [counts.len() - 1, counts.len() / 2, 0] {
            assert_eq!(stale(index), counts[index], "{folder} {index}");
        }
        let lossy = counts.iter().filter(|count| **count > 0).count();
        let found = [scans.len(), lossy, counts.iter().sum()];
        assert_eq!(found, expected, "{folder}");
    }
}

#[test]
fn boreas_rt_is_detected_by_its_chirps_and_fomo_by_its_name() {
    for (folder, format, bin_m, offset_m) in [
        (
            "samples/boreas-rt-2024-12-03",
            Format::BoreasRt,
            0.04381,
            -0.31,
        ),
        ("samples/fomo-2025-10-14", Format::Fomo, 0.0438, -0.32),
    ] {
        let Some(mut scans) = opened(folder) else {
            return;
        };
        assert_eq!((scans.format(), scans.len()), (format, 1));
        assert_eq!(scans.encoder_counts(), Some(5600));
        let scan = scans.scan(0).unwrap();
        // The name of that of Boreas is no time.
        assert_sweep(scans.as_ref(), 0, &scan, 1_000_000);
        let geometry = scan.geometry;
        assert_eq!(geometry.range_resolution_m, bin_m, "{folder}");
        assert_eq!(geometry.range_offset_m, offset_m, "{folder}");
        assert!((scan.azimuth_rad[0] - 7.0 / 5600.0 * TAU).abs() < 1e-6);
        if format == Format::Fomo {
            assert!(scan.flags.iter().all(|f| *f == flag::MEASURED));
            continue;
        }
        assert_eq!(
            (geometry.bins, geometry.stamp_ns),
            (6848, scan.stamp_ns[199])
        );
        let known = flag::MEASURED | flag::CHIRP_KNOWN;
        let mut pairs = scan.flags.chunks(2);
        assert!(pairs.all(|pair| pair == [known, known | flag::CHIRP_UP]));
    }
}

#[test]
fn both_forms_of_mulran_have_the_same_azimuths_and_times() {
    let rows = opened("samples/mulran-kaist03");
    let Some((mut rows, mut raw)) = rows.zip(opened("samples/mulran-kaist03-raw")) else {
        return;
    };
    assert_eq!(rows.format(), Format::MulranOxfordForm);
    assert_eq!(raw.format(), Format::Mulran);
    // The third scan is two seconds after the second: the gap moves no scan.
    let period_ns = rows.period_ns();
    assert!((period_ns - 249_600_000).abs() < 100_000, "{period_ns}");
    for index in 0..rows.len() {
        let one = rows.scan(index).unwrap();
        assert_sweep(rows.as_ref(), index, &one, 1_000_000);
        let Ok(other) = raw.scan(index) else {
            assert!(index >= raw.len());
            continue;
        };
        for row in 0..400 {
            assert_eq!(one.view().row(row), other.view().row(row));
            assert!((one.azimuth_rad[row] - other.azimuth_rad[row]).abs() < 1e-6);
            assert!((one.stamp_ns[row] - other.stamp_ns[row]).abs() < 1_000_000);
        }
        let apart_ns = one.geometry.stamp_ns - other.geometry.stamp_ns;
        assert!(apart_ns.abs() < 1_000_000, "{apart_ns} ns");
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
    let scan = open(&folder, &options).unwrap().scan(0).unwrap();
    let found = DopplerEstimator::default().estimate(&scan.view(), 5.0);
    let found = found.unwrap();
    let [ahead, left] = found.value;
    assert!(ahead.hypot(left) < 0.5, "{found:?}");
    let [xx, _, yy] = found.covariance;
    assert!(xx.max(yy) < 0.04 && found.samples > 100, "{found:?}");
}
