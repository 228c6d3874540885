//! The Debian package and the container: what their recipes name is there, and gyre has the
//! commands that they start.

use std::{
    fs,
    path::{Path, PathBuf},
    process::Command,
};

use toml::{Table, Value};

use crate::{
    PROJECT,
    common::{entries_of, gyre},
};

/// The text of a file of the project.
fn read(path: &str) -> String {
    fs::read_to_string(Path::new(PROJECT).join(path)).unwrap()
}

/// The section of cargo-deb. Its paths are relative to the package's folder.
fn package() -> Table {
    let manifest: Table = read("services/gyre/Cargo.toml").parse().unwrap();
    let metadata = &manifest["package"]["metadata"]["deb"];
    metadata.as_table().unwrap().clone()
}

fn text(value: &Value) -> &str {
    value.as_str().unwrap()
}

/// Returns the files of a path with at most one `*`, in its last part.
fn files(pattern: &str) -> Vec<PathBuf> {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join(pattern);
    let name = path.file_name().unwrap().to_str().unwrap();
    let Some((begin, end)) = name.split_once('*') else {
        return path.is_file().then_some(path).into_iter().collect();
    };
    let files = entries_of(path.parent().unwrap()).into_iter();
    files
        .filter(|file| {
            let name = file.file_name().unwrap().to_str().unwrap();
            name.starts_with(begin) && name.ends_with(end) && file.is_file()
        })
        .collect()
}

/// Returns the places of the files in the installed package, the program among them.
fn installed() -> Vec<String> {
    let package = package();
    let mut installed = Vec::new();
    for asset in package["assets"].as_array().unwrap() {
        let (source, to) = (text(&asset[0]), text(&asset[1]));
        if let Some(built) = source.strip_prefix("target/release/") {
            installed.push(format!("/{to}{built}"));
            continue;
        }
        let files = files(source);
        assert!(!files.is_empty(), "nothing is at {source}");
        installed.extend(files.iter().map(|file| match to.ends_with('/') {
            true => format!("/{to}{}", file.file_name().unwrap().to_str().unwrap()),
            false => format!("/{to}"),
        }));
    }
    installed
}

#[test]
fn the_debian_package_has_what_its_unit_and_its_configurations_name() {
    let installed = installed();
    let has = |path: &str| installed.iter().any(|it| it == path);
    for path in package()["conf-files"].as_array().unwrap() {
        assert!(has(text(path)), "{path}");
    }
    let unit = read("configs/systemd/gyre@.service");
    let of = |key: &str| unit.lines().find_map(|line| line.strip_prefix(key));
    let mut command = of("ExecStart=").unwrap().split(' ');
    assert!(has(command.next().unwrap()));
    let parsed = gyre().args(command).arg("--help").output().unwrap();
    assert!(parsed.status.success(), "{parsed:?}");
    assert!(has(of("Documentation=file://").unwrap()));
    let folder = of("WorkingDirectory=-").unwrap();
    let demo: Table = read("configs/demo.toml").parse().unwrap();
    let model = text(&demo["masking"]["model"]);
    assert!(has(&format!("{folder}/{model}")), "{model}");
}

#[test]
fn the_scripts_of_the_debian_package_are_shell() {
    let folder = text(&package()["maintainer-scripts"]).to_owned();
    for script in ["postinst", "prerm", "postrm"] {
        let script = files(&format!("{folder}/{script}")).pop().unwrap();
        let parsed = Command::new("sh").arg("-n").arg(&script).output().unwrap();
        assert!(parsed.status.success(), "{parsed:?}");
    }
}

#[test]
fn the_container_starts_commands_that_gyre_has_on_files_of_the_package() {
    let recipe = read("configs/container/Containerfile");
    let words = |instruction: &str| -> Vec<String> {
        let (_, list) = recipe.rsplit_once(instruction).unwrap();
        serde_json::from_str(list.lines().next().unwrap()).unwrap()
    };
    let installed = installed();
    assert!(installed.contains(words("\nENTRYPOINT ").last().unwrap()));
    let run = words("\nCMD ");
    let (_, folder) = recipe.rsplit_once("\nWORKDIR ").unwrap();
    let folder = folder.lines().next().unwrap();
    let configuration = format!("{folder}/{}", run.last().unwrap());
    assert!(installed.contains(&configuration), "{configuration}");
    let check = &words(" CMD ")[1..];
    for command in [&run[..], check] {
        let parsed = gyre().args(command).arg("--help").output().unwrap();
        assert!(parsed.status.success(), "{parsed:?}");
    }
}
