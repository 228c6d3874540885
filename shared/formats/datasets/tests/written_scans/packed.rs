//! Recordings that are not unpacked, or of another format than is configured.

use std::fs;

use gyre_datasets::{Format, open};

use super::{assert_rejected, folder, options};
use crate::common::{assert_refused, write_oxford, write_radiate};

#[test]
fn a_file_is_refused_with_what_to_do() {
    let root = folder();
    let file = root.path().join("radar.zip");
    fs::write(&file, b"PK\x03\x04....").unwrap();
    assert_rejected(&file, "(unpack an archive before)");
    assert_rejected(root.path(), "(unpack archives before)");
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
