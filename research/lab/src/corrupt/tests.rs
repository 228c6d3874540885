//! Corrupted copies of recordings: only the scans of the plan are hit, each by what its fault says.
#![allow(clippy::unwrap_used)]

use std::{fs, num::NonZeroUsize, path::Path};

use gyre_datasets::DatasetOptions;
use gyre_geometry::OwnedScan;
use gyre_worlds::{SimulationConfig, write_dataset};
use tempfile::TempDir;

use super::{CorruptArguments, Fault};

const SCANS: usize = 24;
const AZIMUTHS: usize = 16;
const BINS: usize = 21;

/// A tiny recording in RADIATE's form, images on their side, every pixel another.
fn radiate() -> TempDir {
    let folder = tempfile::tempdir().unwrap();
    let images = folder.path().join("Navtech_Polar");
    fs::create_dir(&images).unwrap();
    let stamp = |k: usize| {
        format!(
            "Frame: {:06} Time: {}.{:09}\n",
            k + 7,
            1_549_986_600 + k / 4,
            k % 4 * 250_000_000
        )
    };
    fs::write(
        folder.path().join("Navtech_Polar.txt"),
        (0..SCANS).map(stamp).collect::<String>(),
    )
    .unwrap();
    fs::write(folder.path().join("ground_truth.tum"), "1 0 0 0 0 0 0 1\n").unwrap();
    for k in 0..SCANS {
        let file = fs::File::create(images.join(format!("{:06}.png", k + 7))).unwrap();
        let mut encoder = png::Encoder::new(file, AZIMUTHS as u32, BINS as u32);
        encoder.set_color(png::ColorType::Grayscale);
        let pixels: Vec<u8> = (0..AZIMUTHS * BINS)
            .map(|i| (i * 7 + k * 31) as u8)
            .collect();
        encoder
            .write_header()
            .unwrap()
            .write_image_data(&pixels)
            .unwrap();
    }
    folder
}

/// A corrupted copy of a recording, with the numbers of the scans that were hit.
fn corrupted(source: &Path, fault: Fault, every: usize) -> (TempDir, Vec<usize>) {
    let out = tempfile::tempdir().unwrap();
    let hits = arguments(source, out.path(), fault, every).write().unwrap();
    (out, hits)
}

fn arguments(source: &Path, out: &Path, fault: Fault, every: usize) -> CorruptArguments {
    CorruptArguments {
        path: source.to_owned(),
        fault,
        every: NonZeroUsize::new(every).unwrap(),
        seed: 1,
        out: out.to_owned(),
    }
}

fn scans(folder: &Path) -> Vec<OwnedScan> {
    let mut dataset = gyre_datasets::open(folder, &DatasetOptions::default()).unwrap();
    let indices = 0..dataset.len();
    let read = |index| {
        let mut scan = OwnedScan::with_limits(dataset.limits());
        scan.geometry = dataset.read(index, scan.slot()).unwrap();
        scan
    };
    indices.map(read).collect()
}

fn rows(scan: &OwnedScan) -> Vec<&[u8]> {
    (0..scan.geometry.azimuths)
        .map(|azimuth| scan.view().row(azimuth))
        .collect()
}

#[test]
fn scans_that_are_not_of_the_plan_are_links_to_the_recordings_own() {
    let source = radiate();
    for fault in [Fault::Noise, Fault::Turned, Fault::HalfBlank] {
        let (copy, hits) = corrupted(source.path(), fault, 5);
        assert_eq!(hits, [5, 10, 15, 20], "never the first");
        assert!(copy.path().join("ground_truth.tum").is_symlink());
        for (k, (before, after)) in scans(source.path())
            .iter()
            .zip(&scans(copy.path()))
            .enumerate()
        {
            let image = copy.path().join(format!("Navtech_Polar/{:06}.png", k + 7));
            assert_eq!(image.is_symlink(), !hits.contains(&k));
            assert_eq!(
                before.bytes != after.bytes,
                hits.contains(&k),
                "{fault:?} {k}"
            );
            assert_eq!(
                (before.geometry, &before.stamp_ns),
                (after.geometry, &after.stamp_ns)
            );
        }
    }
}

#[test]
fn a_turned_scan_begins_a_quarter_later() {
    let source = radiate();
    let (copy, _) = corrupted(source.path(), Fault::Turned, 5);
    let (before, after) = (scans(source.path()), scans(copy.path()));
    for azimuth in 0..AZIMUTHS {
        assert_eq!(
            rows(&after[5])[azimuth],
            rows(&before[5])[(azimuth + AZIMUTHS / 4) % AZIMUTHS]
        );
    }
}

#[test]
fn half_of_a_half_blank_scan_is_blank_and_the_other_half_as_it_was() {
    let source = radiate();
    let (copy, _) = corrupted(source.path(), Fault::HalfBlank, 5);
    let (before, after) = (scans(source.path()), scans(copy.path()));
    assert!(
        rows(&after[10])[..AZIMUTHS / 2]
            .iter()
            .all(|row| row.iter().all(|power| *power == 0))
    );
    assert_eq!(
        rows(&after[10])[AZIMUTHS / 2..],
        rows(&before[10])[AZIMUTHS / 2..]
    );
}

#[test]
fn a_scan_ten_later_stands_in_where_there_is_one() {
    let source = radiate();
    let (copy, hits) = corrupted(source.path(), Fault::Later, 5);
    assert_eq!(hits, [5, 10], "24 scans: 13 is the last with one ten later");
    let (before, after) = (scans(source.path()), scans(copy.path()));
    assert_eq!(rows(&after[5]), rows(&before[15]));
    assert_eq!(after[5].stamp_ns, before[5].stamp_ns);
}

#[test]
fn dropped_scans_are_gone_and_the_others_keep_their_times() {
    let source = radiate();
    let (copy, hits) = corrupted(source.path(), Fault::Dropped, 10);
    assert_eq!(hits, [10, 20]);
    let mut before = scans(source.path());
    let after = scans(copy.path());
    for hit in hits.iter().rev() {
        before.remove(*hit);
    }
    assert_eq!(after.len(), SCANS - 2);
    assert!(
        before
            .iter()
            .zip(&after)
            .all(|(b, a)| b.bytes == a.bytes && b.stamp_ns == a.stamp_ns)
    );
}

#[test]
fn noise_is_the_same_for_the_same_seed_and_another_for_each_scan() {
    let source = radiate();
    let noise = |seed| {
        let out = tempfile::tempdir().unwrap();
        let arguments = arguments(source.path(), out.path(), Fault::Noise, 5);
        CorruptArguments { seed, ..arguments }.write().unwrap();
        scans(out.path())
    };
    let (once, again, other) = (noise(1), noise(1), noise(2));
    assert!(once.iter().zip(&again).all(|(a, b)| a.bytes == b.bytes));
    assert_ne!(once[5].bytes, other[5].bytes);
    assert_ne!(once[5].bytes, once[10].bytes);
}

#[test]
fn what_stands_before_an_oxford_row_is_kept() {
    let source = tempfile::tempdir().unwrap();
    write_dataset(
        &SimulationConfig {
            scans: Some(3),
            ..SimulationConfig::default()
        },
        source.path(),
        &mut |_, _| (),
    )
    .unwrap();
    let (copy, hits) = corrupted(source.path(), Fault::Noise, 2);
    assert_eq!(hits, [2]);
    let (before, after) = (&scans(source.path())[2], &scans(copy.path())[2]);
    assert_eq!(
        (&before.stamp_ns, &before.azimuth_rad),
        (&after.stamp_ns, &after.azimuth_rad)
    );
    assert_ne!(rows(before), rows(after));
}

#[test]
fn a_folder_that_holds_something_is_refused() {
    let source = radiate();
    let (copy, _) = corrupted(source.path(), Fault::Noise, 5);
    let again = arguments(source.path(), copy.path(), Fault::Noise, 5);
    let refused = again.write().unwrap_err().to_string();
    assert!(refused.contains("holds `Navtech_Polar`"), "{refused}");
    let (none, new) = (source.path().join("none"), copy.path().join("new"));
    let none = arguments(&none, &new, Fault::Noise, 5).write();
    assert!(none.unwrap_err().to_string().contains("no such folder"));
}
