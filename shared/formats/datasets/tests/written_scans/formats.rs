//! Formats: detection, names and stamps, options; recordings that are not unpacked, or of another
//! format than is configured.

use std::f32::consts::TAU;
use std::fs;
use std::path::Path;

use gyre_datasets::{AzimuthSource, DatasetOptions, Format, OpenError, open};

use super::{assert_rejected, first_scan_with, folder, opened, options};
use crate::common::{
    PERIOD_US, START_US, Sweep, assert_refused, write_oxford, write_png, write_radiate,
};

/// Writes three scans to `folder`, named by the stamp of row `named`; a microsecond has `unit`
/// units of the stamps.
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
        let scan = dataset.scan(1).unwrap();
        assert_eq!(scan.geometry.range_resolution_m, resolution);
        assert_eq!(scan.geometry.range_offset_m, -0.31);
        assert_eq!(scan.geometry.stamp_ns, scan.stamp_ns[19]);
        assert_eq!(dataset.nominal_stamp_ns(1), Some(scan.stamp_ns[19]));
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
        let scan = dataset.scan(1).unwrap();
        let off_ns = dataset.nominal_stamp_ns(1).unwrap() - scan.geometry.stamp_ns;
        assert!(off_ns.abs() < 5_000_000, "{name:?}: {off_ns} ns");
    }
    let root = folder();
    write_named(root.path(), 60, START_US, 0, 1);
    let note = opened(root.path()).notes().join(" ");
    let is_ambiguous = note.contains("read as oxford") && note.contains("`format = \"fomo\"`");
    assert!(is_ambiguous, "{note}");
}

#[test]
fn mulran_is_transposed_and_named_by_the_end_of_the_sweep() {
    let root = folder();
    let end = |k: i64| (START_US + k * PERIOD_US) * 1000;
    for k in 0..3 {
        let name = format!("sensor_data/radar/polar/{}.png", end(k));
        write_png(&root.path().join(name), 40, 60, &[9; 2400]);
    }
    let mut dataset = opened(root.path());
    assert_eq!(dataset.format(), Format::Mulran);
    assert!(dataset.is_transposed());
    let scan = dataset.scan(2).unwrap();
    // The name is the time of the last of 40 columns; the first column is at half a step.
    assert_eq!((scan.stamp_ns[39], scan.geometry.bins), (end(2), 60));
    assert!((scan.azimuth_rad[0] - TAU / 80.0).abs() < 1e-6);
    assert!(scan.geometry.stamp_ns < end(2));
    assert_eq!(dataset.nominal_stamp_ns(2), Some(scan.geometry.stamp_ns));
    assert!((scan.geometry.range_resolution_m - 0.0595238).abs() < 1e-6);
}

#[test]
fn a_row_that_is_a_year_off_makes_its_scan_alone_unreadable_in_every_format_with_row_times() {
    const YEAR_US: i64 = 31_536_000_000_000;
    let formats = [
        (Format::Oxford, 0, 1),
        (Format::Oord, 0, 1),
        (Format::Boreas, 19, 1),
        (Format::BoreasRt, 19, 1),
        (Format::Fomo, 0, 1),
        (Format::MulranOxfordForm, 39, 1000),
    ];
    for (format, named, unit) in formats {
        for off in [-YEAR_US * unit, YEAR_US * unit] {
            let root = folder();
            write_named(root.path(), 60, START_US, named, unit);
            let sweep = Sweep {
                start: (START_US + PERIOD_US) * unit,
                row_interval: PERIOD_US / 40 * unit,
                ..Sweep::default()
            };
            let mut pixels = sweep.pixels();
            let row = &mut pixels[20 * sweep.width()..][..8];
            let stamp = sweep.start + 20 * sweep.row_interval + off;
            row.copy_from_slice(&stamp.to_le_bytes());
            let name = sweep.start + named * sweep.row_interval;
            let path = root.path().join(format!("{name}.png"));
            write_png(&path, sweep.width(), 40, &pixels);
            let options = options(|o| o.format = Some(format));
            let mut dataset = open(root.path(), &options).unwrap();
            assert_refused(dataset.scan(1), "row 20: stamp is 3153");
            assert!(dataset.scan(0).is_ok() && dataset.scan(2).is_ok());
        }
    }
}

#[test]
fn folders_without_a_dataset_are_rejected() {
    let root = folder();
    let refused = |name: &str, words: &[&str]| {
        let path = root.path().join(name);
        let each = words.iter();
        each.for_each(|words| assert_rejected(&path, words));
    };
    refused("nothing", &["no such folder"]);
    refused("", &["holds no PNG images"]);
    fs::write(root.path().join("points.las"), "LASF").unwrap();
    refused("", &["Navtech_Polar", "set its `format`", "bags of ROS 2"]);
    refused("", &["(unpack archives before)"]);
    let names: Vec<_> = Format::OF_IMAGES.iter().map(|it| it.name()).collect();
    refused("", &names);
    refused(
        "points.las",
        &["is a file: give the folder", "(unpack an archive"],
    );
    let configured = options(|o| o.format = Some(Format::Oxford));
    for expected in [
        "says `format = \"oxford\"`, but it holds neither PNG images nor the folder radar;",
        ": is it another folder?",
    ] {
        assert_refused(open(root.path(), &configured), expected);
    }
    fs::create_dir(root.path().join("radar")).unwrap();
    refused("", &["radar holds no PNG images"]);
    write_png(&root.path().join("radar/holiday.png"), 30, 20, &[0; 600]);
    refused(
        "",
        &["is not a known dataset: its images (30 columns x 20 rows)"],
    );
}

#[test]
fn options_out_of_bounds_are_rejected() {
    let root = folder();
    write_radiate(root.path(), 2);
    let edits: [fn(&mut DatasetOptions); 10] = [
        |o| o.range_resolution_m = Some(0.0),
        |o| o.range_resolution_m = Some(0.01757),
        |o| o.range_resolution_m = Some(1.736),
        |o| o.range_offset_m = Some(-80.0),
        |o| o.range_resolution_m = Some(f32::NAN),
        |o| o.range_offset_m = Some(f32::INFINITY),
        |o| o.doppler_s = Some(f32::NAN),
        |o| o.encoder_counts = Some(0),
        |o| o.encoder_counts = Some(5600),
        |o| o.azimuth_source = Some(AzimuthSource::Encoder),
    ];
    for options in edits.map(options) {
        let refused = open(root.path(), &options);
        assert!(
            matches!(refused, Err(OpenError::BadOption { .. })),
            "{options:?}"
        );
    }
    let scan = first_scan_with(root.path(), |o| {
        o.range_resolution_m = Some(1.5);
        o.range_offset_m = Some(-0.5);
        o.doppler_s = Some(0.04);
    });
    let geometry = scan.geometry;
    assert_eq!(geometry.range_resolution_m, 1.5);
    assert_eq!([geometry.range_offset_m, geometry.doppler_s], [-0.5, 0.04]);
}

#[test]
fn options_are_kebab_case_and_unknown_keys_are_rejected() {
    let options: DatasetOptions =
        serde_json::from_str(r#"{"format": "boreas-rt", "azimuth_source": "uniform"}"#).unwrap();
    assert_eq!(options.format, Some(Format::BoreasRt));
    assert_eq!(options.azimuth_source, Some(AzimuthSource::Uniform));
    let none = serde_json::to_string(&DatasetOptions::default());
    assert_eq!(none.unwrap(), "{}");
    assert!(serde_json::from_str::<DatasetOptions>(r#"{"fromat": "oxford"}"#).is_err());
    for format in Format::ALL {
        let written = serde_json::to_string(&format).unwrap();
        assert_eq!(written, format!("\"{format}\""));
    }
}

#[test]
fn a_dataset_of_another_format_than_is_configured_is_called_by_its_own() {
    let root = folder();
    write_radiate(&root.path().join("a"), 2);
    write_oxford(&root.path().join("b"), 2);
    let cases = [
        ("a", Format::Oxford, "radiate"),
        ("a", Format::Oord, "radiate"),
        ("a/Navtech_Polar", Format::Oxford, "radiate"),
        ("b", Format::Radiate, "oxford"),
        ("b/radar", Format::Mulran, "oxford"),
    ];
    for (path, configured, found) in cases {
        let options = options(|o| o.format = Some(configured));
        let expected =
            format!("looks like {found}, but the configuration has `format = \"{configured}\"`");
        assert_refused(open(&root.path().join(path), &options), &expected);
    }
}

#[test]
fn a_folder_with_the_files_and_names_of_another_dataset_is_that() {
    let root = folder();
    write_oxford(&root.path().join("a"), 2);
    fs::write(root.path().join("a/radar.timestamps"), "").unwrap();
    let path = root.path().join("a");
    let opened = |format| open(&path, &options(|o| o.format = Some(format)));
    for format in [Format::Boreas, Format::BoreasRt] {
        assert_refused(opened(format), "looks like oxford");
    }
    // Its files without its names, or its names without its files, may belong to a recording of the
    // user's own.
    assert_eq!(opened(Format::Oxford).unwrap().len(), 2);
    fs::remove_file(root.path().join("a/radar.timestamps")).unwrap();
    assert_eq!(opened(Format::Boreas).unwrap().len(), 2);
    fs::create_dir(root.path().join("a/applanix")).unwrap();
    assert_eq!(opened(Format::Boreas).unwrap().len(), 2);
    assert_eq!(opened(Format::Oxford).unwrap().len(), 2);
}
