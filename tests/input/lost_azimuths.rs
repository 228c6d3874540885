//! A recording of RADIATE whose host lost azimuths: counted in the summary, and put back in an
//! export.

use std::{f64::consts::TAU, fs, path::Path};

use gyre_datasets::{Dataset, DatasetOptions, LostAzimuthOption, open, stored_options};
use gyre_geometry::{OwnedScan, scan::flag};
use gyre_radar::lost::stale_rows;
use serde_json::json;

use crate::common::{Ended, Run, finished, recording};

/// The scans of a recording of RADIATE.
fn scans(recording: &Path) -> Vec<OwnedScan> {
    let options = DatasetOptions {
        lost_azimuths: Some(LostAzimuthOption::Find),
        ..DatasetOptions::default()
    };
    read_all(open(recording, &options).unwrap().as_mut())
}

fn read_all(dataset: &mut dyn Dataset) -> Vec<OwnedScan> {
    let indices = 0..dataset.len();
    indices.map(|index| dataset.scan(index).unwrap()).collect()
}

fn stale(scans: &[OwnedScan]) -> Vec<usize> {
    scans.iter().map(|scan| stale_rows(&scan.view())).collect()
}

/// The mean difference of powers between scans with losses and the whole scans.
fn difference(scans: &[OwnedScan], whole: &[OwnedScan], stale: &[usize]) -> f64 {
    let lossy = (0..scans.len()).filter(|scan| stale[*scan] > 0);
    let powers = lossy.flat_map(|scan| scans[scan].bytes.iter().zip(&whole[scan].bytes));
    let count = powers.clone().count() as f64;
    powers.map(|(a, b)| f64::from(a.abs_diff(*b))).sum::<f64>() / count
}

/// The mean distance, in steps, between the angles of measured rows and their angles in the whole
/// scans.
fn misplaced(scans: &[OwnedScan], whole: &[OwnedScan], stale: &[usize]) -> f64 {
    let mut off = Vec::new();
    for scan in (0..scans.len()).filter(|scan| stale[*scan] > 0) {
        let (scan, whole) = (scans[scan].view(), whole[scan].view());
        let is_measured = |row: &usize| scan.flags[*row] & flag::MEASURED != 0;
        for row in (0..scan.geometry.azimuths).filter(is_measured) {
            let angle = f64::from(scan.azimuth_rad[row]) / TAU * 400.0;
            let is_it = |azimuth: &usize| scan.row(row) == whole.row(*azimuth);
            let azimuth = (0..400).find(is_it).unwrap();
            off.push((angle - azimuth as f64).abs());
        }
    }
    off.iter().sum::<f64>() / off.len() as f64
}

const AS_IMAGES: [&str; 2] = ["--format=radiate", "--out"];

fn export(from: &Path, options: &[&str], to: &Path) -> Ended {
    finished!["export", from; options; [to]]
}

#[test]
fn lost_azimuths_are_counted_and_put_back_in_an_export() {
    let (whole, lossy) = (recording::of_radiate(false), recording::of_radiate(true));
    let run = Run::small().data(&lossy);
    run.complete();
    let (before, true_scans) = (scans(&lossy), scans(&whole));
    let stale_before = stale(&before);
    let lost: usize = stale_before.iter().sum();
    let repaired = stale_before.iter().filter(|stale| **stale > 0).count();
    assert!(lost > repaired && repaired > 5, "{stale_before:?}");
    let counts = json!({"scans": repaired, "azimuths": lost, "unplaced": 0});
    assert_eq!(run.summary()["lost"], counts);

    let out = run.folder().join("repaired");
    let said = export(run.out(), &AS_IMAGES, &out);
    said.succeeded();
    let sentence = format!("{repaired} of them repaired, which had lost {lost} azimuths");
    said.prints(&sentence);
    let after = scans(&out);
    assert_eq!(after.len(), before.len());
    assert_eq!(stale(&after), vec![0; after.len()]);
    let images = recording::images(&lossy).into_iter();
    for (scan, (from, to)) in images.zip(recording::images(&out)).enumerate() {
        let is_copy = fs::read(from).unwrap() == fs::read(to).unwrap();
        assert_eq!(is_copy, stale_before[scan] == 0, "scan {scan}");
    }
    let difference = |scans: &[OwnedScan]| difference(scans, &true_scans, &stale_before);
    let (wrong, right) = (difference(&before), difference(&after));
    assert!(right < 0.9 * wrong, "{wrong} as recorded, {right} repaired");
    for list in ["Navtech_Polar.txt", "ground_truth.tum"] {
        let copied = fs::read(out.join(list)).unwrap();
        assert_eq!(copied, fs::read(lossy.join(list)).unwrap(), "{list}");
    }
    let expected = DatasetOptions {
        lost_azimuths: Some(LostAzimuthOption::Ignore),
        ..stored_options(&lossy).unwrap()
    };
    assert_eq!(stored_options(&out).unwrap(), expected);
    export(run.out(), &AS_IMAGES, &out).failed_with(&["repaired exists: name a new folder"]);

    let bag = run.folder().join("bag.mcap");
    let ended = export(run.out(), &["--mcap"], &bag);
    let sentence = format!("{repaired} scans have lost azimuths: their rows are at the angles");
    ended.succeeded().says(&sentence);
    let mut dataset = gyre_recording::open(&bag, &DatasetOptions::default()).unwrap();
    let misplaced = |scans: &[OwnedScan]| misplaced(scans, &true_scans, &stale_before);
    let (wrong, right) = (misplaced(&before), misplaced(&read_all(dataset.as_mut())));
    assert!(right < 0.85 * wrong, "{wrong} steps, {right} in the bag");
}

#[test]
fn only_runs_that_have_looked_for_lost_azimuths_are_exported_in_radiate_s_form() {
    let ignoring = Run::small().data(&recording::of_radiate(true));
    let ignoring = ignoring.set("dataset.lost_azimuths='ignore'");
    ignoring.complete();
    assert!(ignoring.summary().get("lost").is_none());
    let out = ignoring.folder().join("repaired");
    export(ignoring.out(), &AS_IMAGES, &out)
        .failed_with(&["the run has not looked for lost azimuths"]);
    let other = Run::of_recording();
    other.complete();
    export(other.out(), &AS_IMAGES, &out).failed_with(&["are of the format `oxford`"]);
    export(&recording::of_radiate(true), &AS_IMAGES, &out)
        .failed_with(&["name the folder of its results"]);
    assert!(!out.exists());
}
