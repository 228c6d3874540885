//! Recordings that are not unpacked, of another kind, or of another format than is configured.

use std::fs;

use gyre_datasets::{Format, open};

use super::{folder, options, rejected};
use crate::common::{write_oxford, write_radiate};

#[test]
fn archives_and_bags_of_other_kinds_are_named_with_what_to_do() {
    let mut tar = [0; 512];
    tar[257..262].copy_from_slice(b"ustar");
    let cases: [(&str, &[u8], [&str; 2]); 4] = [
        (
            "drive.bag",
            b"#ROSBAG V2.0\n",
            ["is a bag of ROS 1", "rosbags-convert --src"],
        ),
        (
            "radar.zip",
            b"PK\x03\x04....",
            ["is a ZIP archive", "unpack it"],
        ),
        ("radar.tar", &tar, ["is a tar archive", "unpack it"]),
        (
            "radar.tar.gz",
            b"\x1f\x8b\x08..",
            ["compressed by gzip", "unpack it"],
        ),
    ];
    for (name, bytes, words) in cases {
        let root = folder();
        let file = root.path().join(name);
        fs::write(&file, bytes).unwrap();
        for path in [root.path(), &file] {
            let error = rejected(path).to_string();
            assert!(
                error.contains(name) && words.iter().all(|word| error.contains(word)),
                "{error}"
            );
        }
    }
}

#[test]
fn unknown_data_are_refused_with_what_is_known() {
    let root = folder();
    fs::write(root.path().join("points.las"), "LASF").unwrap();
    let error = rejected(root.path()).to_string();
    for known in Format::ALL.map(Format::name) {
        assert!(error.contains(known), "{known}: {error}");
    }
    assert!(error.contains("bags of ROS 2"), "{error}");
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
        let error = open(&root.path().join(path), &options)
            .err()
            .unwrap()
            .to_string();
        let expected =
            format!("looks like {found}, but the configuration says `format = \"{configured}\"`");
        assert!(error.contains(&expected), "{error}");
    }
}

#[test]
fn a_folder_with_the_files_and_names_of_another_dataset_is_that() {
    let root = folder();
    write_oxford(&root.path().join("a"), 2);
    fs::write(root.path().join("a/radar.timestamps"), "").unwrap();
    let opened = |format| {
        open(
            &root.path().join("a"),
            &options(|o| o.format = Some(format)),
        )
    };
    for format in [Format::Boreas, Format::BoreasRt] {
        let error = opened(format).err().unwrap().to_string();
        assert!(error.contains("looks like oxford"), "{error}");
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

#[test]
fn a_folder_without_what_is_configured_says_so() {
    let root = folder();
    fs::write(root.path().join("points.las"), "LASF").unwrap();
    let options = options(|o| o.format = Some(Format::Oxford));
    let error = open(root.path(), &options).err().unwrap().to_string();
    for words in [
        "says `format = \"oxford\"`",
        "the folder radar",
        "is it another folder?",
    ] {
        assert!(error.contains(words), "{error}");
    }
    assert!(!error.contains("set its"), "{error}");
}
