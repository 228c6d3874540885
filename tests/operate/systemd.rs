//! The unit of systemd: its settings are known to systemd.

use std::{fs, path::Path, process::Command};

use crate::{
    PROJECT,
    common::{can, folder},
    reach::only_if,
};

const UNIT: &str = "configs/systemd/gyre@.service";

#[test]
fn systemd_accepts_the_unit() {
    only_if!(can(&["systemd-analyze", "--version"]));
    let place = folder();
    let unit = fs::read_to_string(Path::new(PROJECT).join(UNIT)).unwrap();
    // Its own program is not installed here.
    let unit = unit.replace("/usr/bin/gyre", crate::PROGRAM);
    let verify = |unit: &str| {
        let path = place.path().join("gyre@demo.service");
        fs::write(&path, unit).unwrap();
        let output = Command::new("systemd-analyze")
            .args(["verify", "--recursive-errors=yes", "--man=no"])
            .arg(&path)
            .output();
        output.unwrap()
    };
    let verified = verify(&unit);
    let said = String::from_utf8_lossy(&verified.stderr).into_owned();
    assert!(verified.status.success() && said.is_empty(), "{said}");
    let misspelt = verify(&unit.replace("WatchdogSec", "WatchdogSecs"));
    assert!(!misspelt.status.success(), "it would not notice a mistake");
}
