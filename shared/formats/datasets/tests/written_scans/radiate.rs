//! RADIATE's list of times.

use std::fs;

use gyre_datasets::{DatasetOptions, inspect};

use super::{assert_rejected, folder, opened};
use crate::common::write_radiate;

#[test]
fn radiate_times_that_are_off_do_not_move_the_other_scans() {
    let root = folder();
    write_radiate(root.path(), 12);
    let stamps = || -> Vec<_> {
        let dataset = opened(root.path());
        let stamps = (0..12).map(|index| dataset.nominal_stamp_ns(index));
        stamps.collect()
    };
    let expected = stamps();
    let list = root.path().join("Navtech_Polar.txt");
    let text = fs::read_to_string(&list).unwrap();
    // A year, or a minute, before or after; a byte order mark is no part of the list.
    for off in ["1518450608", "1549986548", "1549986668", "1581522608"] {
        let time = "Frame: 000011 Time: 1549986608";
        let wrong = text.replace(time, &format!("Frame: 000011 Time: {off}"));
        assert_ne!(wrong, text);
        fs::write(&list, format!("\u{feff}{wrong}")).unwrap();
        assert_eq!(stamps(), expected, "{off}");
        let notes = opened(root.path()).notes().join(" ");
        let sentence = "1 times in Navtech_Polar.txt are more than 10 s from those before and after (frames 11)";
        assert!(notes.contains(sentence), "{notes}");
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

#[test]
fn one_time_that_is_early_moves_no_scan_and_is_named() {
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
    // Frame 20 was received 3.253 s after the first second, and is logged 0.7 s before that.
    let early = text.replace("1549986610.253000000", "1549986609.553000000");
    assert_ne!(early, text);
    fs::write(&list, early).unwrap();
    for (now, before) in stamps().iter().zip(&expected) {
        assert!((now - before).abs() < 1_000, "{now} instead of {before}");
    }
    let report = inspect(root.path(), &DatasetOptions::default(), None).unwrap();
    let findings = report.findings.join(" ");
    assert!(findings.contains("(frames 20 by 0.70 s)"), "{findings}");
    let timing = &report.figures["timing"];
    assert!((timing["period_s"].as_f64().unwrap() - 0.25).abs() < 1e-6);
    for list in ["stalls", "backwards", "gaps"] {
        assert_eq!(timing[list].as_array().unwrap().len(), 0, "{list}");
    }
}
