//! Recordings that are not unpacked, of another kind, or of another format than is configured.

use std::fs;

use gyre_datasets::{Format, open};

use super::{assert_rejected, folder, options};
use crate::common::{assert_refused, write_oxford, write_radiate};

#[test]
fn archives_and_bags_of_other_kinds_are_named_with_what_to_do() {
    let mut tar = [0; 512];
    tar[257..262].copy_from_slice(b"ustar");
    let cases: [(&str, &[u8], &str); 4] = [
        (
            "drive.bag",
            b"#ROSBAG V2.0\n",
            "is a bag of ROS 1: convert it",
        ),
        ("radar.zip", b"PK\x03\x04....", "is an archive"),
        ("radar.tar", &tar, "is an archive, or compressed: unpack it"),
        ("a.tar.gz", b"\x1f\x8b\x08..", "is an archive"),
    ];
    for (name, bytes, words) in cases {
        let root = folder();
        let file = root.path().join(name);
        fs::write(&file, bytes).unwrap();
        for path in [root.path(), &file] {
            assert_rejected(path, &format!("{name} {words}"));
        }
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
