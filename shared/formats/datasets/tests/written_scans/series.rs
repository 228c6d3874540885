//! Folders with images that are not scans, or with images whose names are not times, and RADIATE's
//! list of times.

use std::fs;
use std::path::Path;

use gyre_datasets::{Dataset, DatasetOptions, Format, inspect, open, reopen};

use super::{assert_rejected, folder, opened, options};
use crate::common::{
    PERIOD_US, START_US, Sweep, assert_refused, write_oxford, write_radiate, write_sweeps,
};

/// Writes a scan of the turn `k`.
fn write(path: &Path, k: i64) {
    Sweep::at(START_US + k * PERIOD_US).write(path);
}

fn names(dataset: &dyn Dataset) -> Vec<String> {
    let name = |index| dataset.file(index).file_name().unwrap().to_str().unwrap();
    (0..dataset.len())
        .map(|index| name(index).to_owned())
        .collect()
}

#[test]
fn images_that_are_not_named_by_times_are_in_the_order_of_their_rows_times() {
    // In the order of text scan10 is before scan2, and view_b is before view_z.
    for named in [
        "scan1 scan2 scan9 scan10 scan11",
        "view_z view_b 7 9 xx",
        "5 4 3 2 1",
    ] {
        let root = folder();
        let expected: Vec<_> = named.split(' ').map(|name| format!("{name}.png")).collect();
        for (k, name) in expected.iter().enumerate() {
            write(&root.path().join("radar").join(name), k as i64);
        }
        for format in [Format::Oxford, Format::Boreas, Format::Fomo] {
            let options = options(|o| o.format = Some(format));
            let images = root.path().join("radar");
            let mut dataset = open(&images, &options).unwrap();
            assert_eq!(names(dataset.as_ref()), expected, "{format}");
            assert_eq!(dataset.period_ns(), PERIOD_US * 1000);
            let again = reopen(&images, &options, format, dataset.files().to_vec()).unwrap();
            for index in 0..5 {
                let stamp_ns = dataset.scan(index).unwrap().geometry.stamp_ns;
                let middle_ns = (START_US + index as i64 * PERIOD_US + 122_000) * 1000;
                let nominal_ns = dataset.nominal_stamp_ns(index).unwrap();
                for expected_ns in [middle_ns, nominal_ns] {
                    let off_ns = stamp_ns - expected_ns;
                    assert!(off_ns.abs() < 4_000_000, "{format} {index}: {off_ns}");
                }
                assert_eq!(again.nominal_stamp_ns(index), Some(nominal_ns));
                assert_eq!(again.file(index), dataset.file(index));
            }
        }
    }
}

#[test]
fn a_clock_that_is_set_back_breaks_the_time_of_numbered_images_once() {
    let root = folder();
    let images = root.path().join("radar");
    for k in 0..40 {
        let back_us = if k < 20 { 0 } else { 3_100_000 };
        let sweep = Sweep::at(START_US + k * PERIOD_US - back_us);
        sweep.write(&images.join(format!("scan{}.png", k + 1)));
    }
    let expected: Vec<_> = (1..=40).map(|k| format!("scan{k}.png")).collect();
    for format in [Format::Oxford, Format::Boreas, Format::Fomo] {
        let options = options(|o| o.format = Some(format));
        let mut dataset = open(&images, &options).unwrap();
        assert_eq!(names(dataset.as_ref()), expected, "{format}");
        assert_eq!(dataset.period_ns(), PERIOD_US * 1000);
        let notes = dataset.notes().join(" ");
        assert!(notes.contains("in the order of their names"), "{notes}");
        let again = reopen(&images, &options, format, dataset.files().to_vec()).unwrap();
        let times: Vec<_> = (0..40).map(|k| again.nominal_stamp_ns(k)).collect();
        let back: Vec<_> = (1..40).filter(|k| times[*k] < times[k - 1]).collect();
        assert_eq!((names(again.as_ref()), back), (expected.clone(), vec![20]));
        assert!((0..40).all(|index| dataset.scan(index).is_ok()));
    }
}

#[test]
fn inspect_has_times_and_gaps_of_images_that_are_not_named_by_times() {
    let root = folder();
    let images = root.path().join("radar");
    for (number, k) in [(1, 0), (2, 1), (3, 2), (10, 5), (11, 6)] {
        write(&images.join(format!("scan{number}.png")), k);
    }
    fs::copy(images.join("scan2.png"), images.join("scan2 (1).png")).unwrap();
    fs::write(images.join("scan4.png"), "damaged").unwrap();
    let report = inspect(root.path(), &DatasetOptions::default()).unwrap();
    let (findings, timing) = (report.findings.join(" "), &report.figures["timing"]);
    let unreadable = report.figures["unreadable"].as_array().unwrap();
    assert_eq!((report.scans, unreadable.len()), (6, 1));
    assert_eq!(unreadable[0]["scan"], 3);
    assert!((timing["period_s"].as_f64().unwrap() - 0.25).abs() < 1e-9);
    // The damaged image takes the place of one of the two that are missing.
    assert_eq!(timing["missing_scans"], 1);
    assert_eq!(timing["gaps"][0]["scan"], 4);
    for sentence in [
        "ordered by the times of their first rows",
        "1 image is left out, with the times of other images in the rows: `scan2 (1).png`",
    ] {
        assert!(findings.contains(sentence), "{findings}");
    }
    let meaning = &report.figures["stamp_meaning"];
    assert!(!meaning.as_str().unwrap().contains("named"), "{meaning}");
}

#[test]
fn copies_and_hidden_files_are_no_scans_and_are_named() {
    for write_files in [write_oxford, write_radiate] {
        let root = folder();
        let files = write_files(root.path(), 6);
        for (index, file) in files.iter().enumerate() {
            let stem = file.file_stem().unwrap().to_str().unwrap();
            fs::write(file.with_file_name(format!("._{stem}.png")), "Mac OS X").unwrap();
            if index % 2 == 0 {
                fs::copy(file, file.with_file_name(format!("{stem} (1).png"))).unwrap();
            }
        }
        fs::copy(&files[0], files[0].with_file_name("overview.png")).unwrap();
        let dataset = opened(root.path());
        let listed = (0..dataset.len()).map(|index| dataset.file(index));
        assert!(listed.eq(files.iter()));
        let notes = dataset.notes().join(" ");
        let first = files[0].file_stem().unwrap().to_str().unwrap();
        let sentence = "10 images are left out, not of the series by name: `._";
        assert!(notes.contains(sentence) && notes.contains(first), "{notes}");
    }
    let root = folder();
    fs::write(root.path().join("._1547131046353776.png"), "Mac OS X").unwrap();
    assert_rejected(root.path(), "is not a known dataset");
}

#[test]
fn scans_with_fewer_rows_are_read_with_the_azimuths_that_there_are() {
    let rows_of = |k| if matches!(k, 0 | 3) { 38 } else { 40 };
    for (name, format) in [
        ("Navtech_CTS350-X_Radar", Format::Oord),
        ("navtech", Format::Fomo),
    ] {
        let root = folder();
        write_sweeps(&root.path().join(name), 6, |k, sweep| {
            sweep.rows = rows_of(k);
        });
        let mut dataset = opened(root.path());
        assert_eq!(dataset.format(), format);
        assert_eq!(dataset.image_size().height, 40);
        for k in 0..6 {
            let scan = dataset.scan(k).unwrap();
            let rows = rows_of(k as i64);
            assert_eq!(scan.geometry.azimuths, rows, "{format}, scan {k}");
            let turn = std::f32::consts::TAU;
            let expected = match format {
                Format::Oord => turn / rows as f32,
                _ => turn * (13.0 + 140.0) / 5600.0,
            };
            let off = scan.azimuth_rad[1] - expected;
            assert!(off.abs() < 1e-6, "{format}, scan {k}");
            assert_eq!(scan.view().row(rows - 1)[5], Sweep::power(rows - 1, 5));
        }
        let report = inspect(root.path(), &DatasetOptions::default()).unwrap();
        assert_eq!(report.figures["azimuths"], 40);
        assert_eq!(report.figures["rows"]["in_scan"][0], 38);
        let findings = report.findings.join(" ");
        assert!(findings.contains("Scans have 38 to 40 rows"), "{findings}");
    }
}

#[test]
fn an_image_without_encoder_and_with_half_a_turn_is_refused() {
    let root = folder();
    let images = root.path().join("Navtech_CTS350-X_Radar");
    write_sweeps(&images, 4, |k, sweep| {
        sweep.rows = if k == 0 { 20 } else { 40 };
    });
    let mut dataset = opened(root.path());
    let expected = "most images of the dataset are 71 columns x 40 rows";
    assert_refused(dataset.scan(0), expected);
    assert!((1..4).all(|index| dataset.scan(index).is_ok()));
}

#[test]
fn radiate_times_that_are_off_do_not_move_the_scans_and_are_named() {
    let root = folder();
    write_radiate(root.path(), 40);
    let stamps = || -> Vec<_> {
        let dataset = opened(root.path());
        let stamps = (0..40).map(|index| dataset.nominal_stamp_ns(index).unwrap());
        stamps.collect()
    };
    let expected = stamps();
    let list = root.path().join("Navtech_Polar.txt");
    let text = fs::read_to_string(&list).unwrap();
    let far =
        "1 times in Navtech_Polar.txt are more than 10 s from those before and after (frames 11)";
    let frame_11 = "Frame: 000011 Time: 1549986608";
    // A year, or a minute, before or after; a byte order mark is no part of the list. Frame 20 was
    // received 3.253 s after the first second, and is logged 0.7 s before that.
    for (time, off, sentence) in [
        (frame_11, "Frame: 000011 Time: 1518450608", far),
        (frame_11, "Frame: 000011 Time: 1549986548", far),
        (frame_11, "Frame: 000011 Time: 1549986668", far),
        (frame_11, "Frame: 000011 Time: 1581522608", far),
        (
            "1549986610.253000000",
            "1549986609.553000000",
            "(frames 20 by 0.70 s)",
        ),
    ] {
        let wrong = text.replace(time, off);
        assert_ne!(wrong, text);
        fs::write(&list, format!("\u{feff}{wrong}")).unwrap();
        for (now, before) in stamps().iter().zip(&expected) {
            assert!((now - before).abs() < 1_000, "{off}: {now}, not {before}");
        }
        let report = inspect(root.path(), &DatasetOptions::default()).unwrap();
        let (findings, timing) = (report.findings.join(" "), &report.figures["timing"]);
        assert!(findings.contains(sentence), "{findings}");
        assert!((timing["period_s"].as_f64().unwrap() - 0.25).abs() < 1e-6);
        for list in ["stalls", "backwards", "gaps"] {
            assert_eq!(timing[list].as_array().unwrap().len(), 0, "{list}");
        }
    }
}

#[test]
fn a_list_without_all_times_is_named_with_the_first_image_that_it_lacks() {
    let root = folder();
    write_radiate(root.path(), 2);
    let list = root.path().join("Navtech_Polar.txt");
    fs::write(&list, "Frame: 000007 Time: 1549986607.5\n").unwrap();
    let expected = "Navtech_Polar.txt has no times of 1 of 2 images, 000008.png first";
    assert_rejected(root.path(), expected);
    fs::write(&list, "Frame: 000007 Time: 1549986607.5\nnonsense\n").unwrap();
    assert_rejected(root.path(), "line 2");
    fs::remove_file(&list).unwrap();
    let words = format!("there is no {}: it lists the times", list.display());
    assert_rejected(root.path(), &words);
}
