//! Saved places are refused when they are damaged.

use std::{fs, path::Path};

use gyre_geometry::pose;
use gyre_slam::estimation::places::PlaceIndex;

use super::scenes;

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

/// The error message for an invalid file.
fn refused(path: &Path, bytes: &[u8]) -> String {
    fs::write(path, bytes).unwrap();
    PlaceIndex::load(path).err().unwrap().to_string()
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
        let sentence = refused(&path, &bytes);
        assert!(sentence.contains("places"), "{at}: {sentence}");
    }
    for len in [0, 7, 28, 31, 32, good.len() - 1] {
        let sentence = refused(&path, &good[..len]);
        assert!(
            sentence.contains("is not a file of places") || sentence.contains("is damaged: it has"),
            "{sentence}"
        );
    }
    let mut longer = good.clone();
    longer.push(0);
    assert!(refused(&path, &longer).contains("which do not fit its 4 places"));
    let mut newer = good.clone();
    newer[8] = 2;
    assert!(
        refused(&path, &newer)
            .contains("has version 2 of places, but this program reads version 1")
    );
    let mut many = good;
    many[20..28].fill(0xff);
    assert!(refused(&path, &many).contains("is damaged"));
    assert!(PlaceIndex::load(&folder.path().join("none")).is_err());
    let unwritable = saved(&path).save(&folder.path().join("none/places"));
    assert!(
        unwritable
            .unwrap_err()
            .to_string()
            .starts_with("cannot write")
    );
}
