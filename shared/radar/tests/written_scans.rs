//! Readers on small generated datasets, valid and invalid.
#![allow(clippy::unwrap_used)]

mod common;

use std::f32::consts::TAU;
use std::fs;
use std::path::Path;

use common::{PERIOD_US, START_US, Sweep, read, write_oxford, write_png, write_radiate};
use gyre_radar::scan::flag;
use gyre_radar::{
    AzimuthSource, Dataset, DatasetOptions, Format, OpenError, OwnedScan, ReadError, ScanLimits,
    open,
};
use tempfile::TempDir;

fn folder() -> TempDir {
    tempfile::tempdir().unwrap()
}

fn opened(root: &Path) -> Box<dyn Dataset> {
    open(root, &DatasetOptions::default()).unwrap()
}

fn rejected(root: &Path) -> OpenError {
    open(root, &DatasetOptions::default()).err().unwrap()
}

fn first_scan(root: &Path) -> Result<OwnedScan, ReadError> {
    read(opened(root).as_mut(), 0)
}

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
    let (rotated, short) = (error(2).unwrap().to_string(), error(3).unwrap().to_string());
    assert!(
        rotated.contains("40 columns x 71 rows")
            && rotated.ends_with("it is rotated by 90 degrees"),
        "{rotated}"
    );
    assert!(
        short.ends_with("first image of the dataset is 71 columns x 40 rows"),
        "{short}"
    );
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
}

#[test]
fn a_truncated_or_corrupt_image_gives_an_error_and_no_panic() {
    let root = folder();
    let files = write_oxford(root.path(), 2);
    let whole = fs::read(&files[1]).unwrap();
    let mut dataset = opened(root.path());
    let mut scan = OwnedScan::with_limits(dataset.limits());
    for length in (0..whole.len() - 12).step_by(7) {
        fs::write(&files[1], &whole[..length]).unwrap();
        assert!(
            dataset.read(1, scan.slot()).is_err(),
            "{length} of {} bytes",
            whole.len()
        );
    }
    for place in 0..whole.len() {
        let mut damaged = whole.clone();
        damaged[place] ^= 0x55;
        fs::write(&files[1], damaged).unwrap();
        let _ = dataset.read(1, scan.slot());
    }
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

/// Writes three scans to `folder`, named by the stamp of row `named`; a microsecond has `unit` units of the stamps.
fn write_named(folder: &Path, bins: usize, start_us: i64, named: i64, unit: i64) {
    for k in 0..3 {
        let start = (start_us + k * PERIOD_US) * unit;
        let sweep = Sweep {
            bins,
            start,
            row_interval: PERIOD_US / 40 * unit,
            ..Sweep::default()
        };
        sweep.write(&folder.join(format!("{}.png", start + named * sweep.row_interval)));
    }
}

#[test]
fn boreas_resolution_depends_on_the_date_and_its_time_is_the_middle_row() {
    for (start_us, resolution) in [
        (1_630_000_000_000_000, 0.0596),
        (1_632_182_400_000_000, 0.04381),
    ] {
        let root = folder();
        fs::create_dir(root.path().join("applanix")).unwrap();
        write_named(&root.path().join("radar"), 3360, start_us, 19, 1);
        let mut dataset = opened(root.path());
        assert_eq!(dataset.format(), Format::Boreas);
        let scan = read(dataset.as_mut(), 1).unwrap();
        assert_eq!(
            (
                scan.geometry.range_resolution_m,
                scan.geometry.range_offset_m
            ),
            (resolution, -0.31)
        );
        assert_eq!(
            (scan.geometry.stamp_ns, dataset.nominal_stamp_ns(1)),
            (scan.stamp_ns[19], Some(scan.stamp_ns[19]))
        );
    }
}

#[test]
fn formats_are_detected_from_layouts_and_first_images() {
    let cases: [(&str, usize, i64, i64, Format); 6] = [
        ("navtech", 60, 0, 1, Format::Fomo),
        ("Navtech_CTS350-X_Radar", 60, 0, 1, Format::Oord),
        ("polar_oxford_form", 60, 39, 1000, Format::MulranOxfordForm),
        ("radar", 3768, 0, 1, Format::Oxford),
        ("", 3360, 39, 1000, Format::MulranOxfordForm),
        ("", 3360, 19, 1, Format::Boreas),
    ];
    for (name, bins, named, unit, format) in cases {
        let root = folder();
        write_named(&root.path().join(name), bins, START_US, named, unit);
        let mut dataset = opened(root.path());
        assert_eq!(dataset.format(), format, "{name:?}: {:?}", dataset.notes());
        let scan = read(dataset.as_mut(), 1).unwrap();
        let error = (dataset.nominal_stamp_ns(1).unwrap() - scan.geometry.stamp_ns).abs();
        assert!(
            error < 5_000_000,
            "{name:?}: nominal time is off by {error} ns"
        );
    }
}

#[test]
fn an_ambiguous_format_is_reported_with_its_alternative() {
    let root = folder();
    write_named(root.path(), 60, START_US, 0, 1);
    let dataset = opened(root.path());
    let note = dataset.notes().join(" ");
    assert!(
        note.contains("read as oxford") && note.contains("`format = \"fomo\"`"),
        "{note}"
    );
}

#[test]
fn oord_has_uniform_azimuths() {
    let root = folder();
    let sweep = Sweep {
        step: 0,
        ..Sweep::default()
    };
    sweep.write(
        &root
            .path()
            .join(format!("Navtech_CTS350-X_Radar/{START_US}.png")),
    );
    let scan = first_scan(root.path()).unwrap();
    assert!((scan.azimuth_rad[10] - 0.25 * TAU).abs() < 1e-6);
    assert_eq!(scan.geometry.range_resolution_m, 0.0438);
}

#[test]
fn mulran_is_transposed_and_named_by_the_end_of_the_sweep() {
    let root = folder();
    let end = |k: i64| (START_US + k * PERIOD_US) * 1000;
    for k in 0..3 {
        write_png(
            &root
                .path()
                .join(format!("sensor_data/radar/polar/{}.png", end(k))),
            40,
            60,
            &[9; 2400],
        );
    }
    let mut dataset = opened(root.path());
    assert_eq!(
        (dataset.format(), dataset.is_transposed()),
        (Format::Mulran, true)
    );
    let scan = read(dataset.as_mut(), 2).unwrap();
    assert_eq!((scan.stamp_ns[0], scan.geometry.bins), (end(1), 60));
    assert!(
        scan.geometry.stamp_ns < end(2)
            && dataset.nominal_stamp_ns(2) == Some(scan.geometry.stamp_ns)
    );
    assert!((scan.geometry.range_resolution_m - 0.0595238).abs() < 1e-6);
}

#[test]
fn radiate_without_stamps_names_the_file() {
    let root = folder();
    write_radiate(root.path(), 2);
    let list = root.path().join("Navtech_Polar.txt");
    fs::write(&list, "Frame: 000007 Time: 1549986607.5\n").unwrap();
    let error = rejected(root.path()).to_string();
    assert!(
        error.contains("Navtech_Polar.txt") && error.contains("000008.png"),
        "{error}"
    );
    fs::write(&list, "Frame: 000007 Time: 1549986607.5\nnonsense\n").unwrap();
    let error = rejected(root.path()).to_string();
    assert!(error.contains("line 2"), "{error}");
    fs::remove_file(&list).unwrap();
    assert!(
        matches!(rejected(root.path()), OpenError::Io { path, .. } if path.ends_with("Navtech_Polar.txt"))
    );
}

#[test]
fn folders_without_a_dataset_are_rejected() {
    let root = folder();
    assert!(matches!(
        rejected(&root.path().join("nothing")),
        OpenError::Missing { .. }
    ));
    assert!(matches!(rejected(root.path()), OpenError::NoImages { .. }));
    fs::write(root.path().join("notes.txt"), "hello").unwrap();
    let error = rejected(root.path()).to_string();
    assert!(
        error.contains("Navtech_Polar") && error.contains("`format`"),
        "{error}"
    );
    assert!(matches!(
        rejected(&root.path().join("notes.txt")),
        OpenError::NotAFolder { .. }
    ));
    fs::create_dir(root.path().join("radar")).unwrap();
    assert!(
        matches!(rejected(root.path()), OpenError::NoImages { path } if path.ends_with("radar"))
    );
    write_png(&root.path().join("radar/holiday.png"), 30, 20, &[0; 600]);
    assert!(matches!(
        rejected(root.path()),
        OpenError::UnknownLayout { .. }
    ));
}

#[test]
fn options_out_of_bounds_are_rejected() {
    let root = folder();
    write_radiate(root.path(), 2);
    let none = DatasetOptions::default();
    let cases = [
        DatasetOptions {
            range_resolution_m: Some(0.0),
            ..none
        },
        DatasetOptions {
            range_resolution_m: Some(f32::NAN),
            ..none
        },
        DatasetOptions {
            range_offset_m: Some(f32::INFINITY),
            ..none
        },
        DatasetOptions {
            doppler_s: Some(f32::NAN),
            ..none
        },
        DatasetOptions {
            encoder_counts: Some(0),
            ..none
        },
        DatasetOptions {
            encoder_counts: Some(5600),
            ..none
        },
        DatasetOptions {
            azimuth_source: Some(AzimuthSource::Encoder),
            ..none
        },
    ];
    for options in cases {
        assert!(
            matches!(
                open(root.path(), &options),
                Err(OpenError::BadOption { .. })
            ),
            "{options:?}"
        );
    }
    let options = DatasetOptions {
        range_resolution_m: Some(1.5),
        range_offset_m: Some(-0.5),
        doppler_s: Some(0.04),
        ..none
    };
    let scan = read(open(root.path(), &options).unwrap().as_mut(), 0).unwrap();
    assert_eq!(
        (
            scan.geometry.range_resolution_m,
            scan.geometry.range_offset_m
        ),
        (1.5, -0.5)
    );
    assert_eq!(scan.geometry.doppler_s, 0.04);
}

#[test]
fn options_are_kebab_case_and_unknown_keys_are_rejected() {
    let options: DatasetOptions =
        serde_json::from_str(r#"{"format": "boreas-rt", "azimuth_source": "uniform"}"#).unwrap();
    assert_eq!(
        (options.format, options.azimuth_source),
        (Some(Format::BoreasRt), Some(AzimuthSource::Uniform))
    );
    assert_eq!(
        serde_json::to_string(&DatasetOptions::default()).unwrap(),
        "{}"
    );
    assert!(serde_json::from_str::<DatasetOptions>(r#"{"fromat": "oxford"}"#).is_err());
    for format in Format::ALL {
        assert_eq!(
            serde_json::to_string(&format).unwrap(),
            format!("\"{format}\"")
        );
    }
}
