//! The command line: names that are not UTF-8, folders in place of files, and runs of other users.

use std::{
    ffi::{OsStr, OsString},
    fs,
    os::unix::{
        ffi::OsStrExt,
        fs::{PermissionsExt, symlink},
    },
    path::{Path, PathBuf},
};

use crate::common::{Ended, OtherUser, finished, folder, recording};

/// A name with a byte that no UTF-8 has.
fn unprintable(folder: &Path) -> PathBuf {
    folder.join(OsStr::from_bytes(b"dr\xffive"))
}

fn run_of(data: impl AsRef<OsStr>, out: impl AsRef<OsStr>) -> Ended {
    finished!["run", data, "--out", out]
}

#[test]
fn a_recording_or_results_whose_name_is_not_utf_8_are_refused_as_that() {
    let folder = folder();
    let named = unprintable(folder.path());
    symlink(recording::small(), &named).unwrap();
    let out = folder.path().join("out");
    let sentence = ["dr\\xFFive\" has a name that is not UTF-8", "rename it"];
    run_of(&named, &out).refused_with(&sentence);
    let mut bare = OsString::from(&named);
    bare.push("-results");
    run_of(recording::small(), &bare)
        .failed_with(&["dr\\xFFive-results\" has a name that is not UTF-8"]);
    assert!(!out.exists() && !Path::new(&bare).exists());
    // A configuration is only read.
    let configuration = named.with_extension("toml");
    fs::write(&configuration, "[raster]\nn = 127\ncell_m = 0.8\n").unwrap();
    finished!["run", configuration, recording::small(), "--out", &out].succeeded();
}

#[test]
fn a_folder_in_place_of_a_configuration_is_refused_with_what_to_name() {
    let folder = folder();
    let run = |named: &Path| finished!["simulate", named, "--out", folder.path().join("drive")];
    run(recording::small()).refused_with(&["the configuration ", " is a folder: name a TOML file"]);
    fs::write(folder.path().join("config.toml"), "").unwrap();
    let own = folder.path().join("config.toml");
    run(folder.path()).refused_with(&[
        " is a folder: name the configuration in it, ",
        own.to_str().unwrap(),
    ]);
}

/// Results are their user's alone, so nobody else knows whether a run has keyframes.
#[test]
fn a_run_of_another_user_is_said_to_be_unreadable() {
    let folder = folder();
    let Some(other) = OtherUser::new(folder.path()) else {
        return;
    };
    let run = folder.path().join("run");
    fs::create_dir_all(run.join("journal")).unwrap();
    for name in ["keyframes.log", "poses.journal"] {
        fs::write(run.join("journal").join(name), "").unwrap();
    }
    fs::set_permissions(&run, fs::Permissions::from_mode(0o700)).unwrap();
    for (command, option, file) in [
        ("map", "--out", "keyframes.log"),
        ("export", "--mcap", "poses.journal"),
    ] {
        let mut gyre = other.gyre();
        gyre.arg(command).arg(&run).arg(option);
        gyre.arg(folder.path().join("new.mcap"));
        Ended::of(gyre).refused_with(&["cannot read", file, "Permission denied"]);
    }
}
