//! Saved places are refused when they are damaged.

use std::{fs, path::Path};

use gyre_geometry::pose;
use gyre_slam::estimation::places::PlaceIndex;

use super::scenes;
use crate::common::assert_refused;

fn saved(path: &Path) -> PlaceIndex {
    let mut index = PlaceIndex::default();
    for k in 0..4 {
        let seen = scenes::seen(&scenes::place(k), &pose(0.0, 0.0, 0.1 * k as f64));
        let descriptor = scenes::describe(&seen);
        index.insert(10 + k, 2.5 * k as f64, &descriptor).unwrap();
    }
    index.save(path).unwrap();
    index
}

/// Asserts that a file of this content is refused.
fn refused(path: &Path, bytes: &[u8], words: &str) {
    fs::write(path, bytes).unwrap();
    assert_refused(PlaceIndex::load(path), words);
}

#[test]
fn damaged_files_are_refused_in_a_sentence() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("places");
    saved(&path);
    let good = fs::read(&path).unwrap();
    for at in (0..good.len()).step_by(331).chain([good.len() - 1]) {
        let mut bytes = good.clone();
        bytes[at] ^= 0x10;
        refused(&path, &bytes, "places");
    }
    for len in [0, 7, 28, 31] {
        refused(&path, &good[..len], "is not a file of places");
    }
    for len in [32, good.len() - 1] {
        refused(&path, &good[..len], "is damaged: it has");
    }
    let mut longer = good.clone();
    longer.push(0);
    refused(&path, &longer, "which do not fit its 4 places");
    let mut newer = good.clone();
    newer[8] = 2;
    let words = "has version 2 of places, but this program reads version 1";
    refused(&path, &newer, words);
    let mut many = good;
    many[20..28].fill(0xff);
    refused(&path, &many, "is damaged");
    assert!(PlaceIndex::load(&folder.path().join("none")).is_err());
    let unwritable = saved(&path).save(&folder.path().join("none/places"));
    assert_refused(unwritable, "cannot write");
}
