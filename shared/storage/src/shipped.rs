//! The program's own files: its configurations, the networks, and a trajectory.
//!
//! Each has a path that begins with `gyre:`, as `gyre:configs/oxford.toml`, and [`bytes`] returns
//! its content. Files that are not in the program itself may be in the folder `share/gyre` of its
//! installation, where the larger networks are.

use std::{
    env,
    path::{Component, Path, PathBuf},
};

const PREFIX: &str = "gyre:";
const CONFIGURATIONS: &str = "configs";
/// The folder of other files, relative to the program's folder.
const SHARE: &str = "../share/gyre";

macro_rules! files {
    ($($path:literal)*) => {
        &[$(($path, include_bytes!(concat!("../../../", $path)))),*]
    };
}

const FILES: &[(&str, &[u8])] = files![
    "configs/boreas-rt.toml"
    "configs/boreas.toml"
    "configs/checchin.toml"
    "configs/demo.toml"
    "configs/f-mbym.toml"
    "configs/fast-mbym.toml"
    "configs/fomo.toml"
    "configs/k2pi-checchin.toml"
    "configs/k2pi.toml"
    "configs/mbym.toml"
    "configs/mulran.toml"
    "configs/navtech-cir204h.toml"
    "configs/navtech-cts350x.toml"
    "configs/navtech-ras6.toml"
    "configs/oxford.toml"
    "configs/radiate.toml"
    "configs/stop-and-go.toml"
    "configs/stop-and-go.tum"
    "models/gyre-255.onnx"
    "models/gyre-255.toml"
    "models/light-255.onnx"
    "models/light-255.toml"
    "models/objects.onnx"
];

pub fn is_own(path: &Path) -> bool {
    path.to_str().is_some_and(|path| path.starts_with(PREFIX))
}

/// Returns the content of a file in the program, by its path `gyre:FOLDER/NAME`.
pub fn bytes(path: &Path) -> Option<&'static [u8]> {
    let path = path.to_str()?.strip_prefix(PREFIX)?;
    let found = FILES.iter().find(|(known, _)| *known == path);
    found.map(|(_, bytes)| *bytes)
}

/// Returns the content of a text in the program, by its path `gyre:FOLDER/NAME`.
pub fn text(path: &Path) -> Option<&'static str> {
    bytes(path).and_then(|bytes| str::from_utf8(bytes).ok())
}

/// Returns the path of a file of the program that a relative path names, as `models/gyre-255.toml`
/// or, of the configurations and what belongs to them, `stop-and-go.tum`: in the program, else in
/// its installation.
pub fn find(relative: &Path) -> Option<PathBuf> {
    let is_plain = |part: Component| matches!(part, Component::Normal(_));
    if !relative.components().all(is_plain) {
        return None;
    }
    let own = [
        relative.to_owned(),
        Path::new(CONFIGURATIONS).join(relative),
    ];
    let own = own.iter().filter_map(|path| path.to_str());
    let mut own = own.map(|path| PathBuf::from(format!("{PREFIX}{path}")));
    own.find(|path| bytes(path).is_some())
        .or_else(|| installed(relative))
}

/// Returns the path of a file of the installation, which lies in `bin` and `share`.
fn installed(relative: &Path) -> Option<PathBuf> {
    let program = env::current_exe().ok()?;
    let share = program.parent()?.join(SHARE).canonicalize().ok()?;
    Some(share.join(relative)).filter(|path| path.is_file())
}

pub fn configuration(name: &Path) -> Option<PathBuf> {
    let name = name.to_str().filter(|name| !name.contains('/'))?;
    let name = name.strip_suffix(".toml").unwrap_or(name);
    let path = PathBuf::from(format!("{PREFIX}{CONFIGURATIONS}/{name}.toml"));
    bytes(&path).map(|_| path)
}

/// Returns the names of all configurations and what each is for, the first sentence of its file.
pub fn configurations() -> impl Iterator<Item = (&'static str, String)> {
    FILES.iter().filter_map(|(path, bytes)| {
        let name = path.strip_prefix(CONFIGURATIONS)?.strip_prefix('/')?;
        let text = str::from_utf8(bytes).unwrap_or_default();
        Some((name.strip_suffix(".toml")?, purpose(text)))
    })
}

fn purpose(text: &str) -> String {
    let comment = text.lines().map_while(|line| line.strip_prefix('#'));
    let comment: Vec<&str> = comment.map(str::trim).collect();
    let comment = comment.join(" ");
    let ends = comment.match_indices(". ").map(|(end, _)| &comment[..end]);
    let sentence = ends
        .into_iter()
        .find(|text| !["al", "Eq"].iter().any(|it| text.ends_with(it)));
    sentence
        .unwrap_or(&comment)
        .trim_end_matches('.')
        .to_owned()
}

#[cfg(test)]
mod tests {
    use std::fs;

    use super::*;

    const PROJECT: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../..");

    #[test]
    fn every_configuration_of_the_project_is_in_the_program() {
        let listed: Vec<String> = configurations().map(|(name, _)| name.to_owned()).collect();
        let files = fs::read_dir(Path::new(PROJECT).join(CONFIGURATIONS)).unwrap();
        let files = files.map(|file| file.unwrap().path());
        let mut there: Vec<String> = files
            .filter(|file| file.extension().is_some_and(|it| it == "toml"))
            .map(|file| file.file_stem().unwrap().to_str().unwrap().to_owned())
            .collect();
        there.sort();
        let mut sorted = listed.clone();
        sorted.sort();
        assert_eq!(sorted, there);
    }

    #[test]
    fn each_configuration_says_what_it_is_for() {
        for (name, purpose) in configurations() {
            assert!(purpose.len() > 10, "{name}: {purpose}");
        }
    }

    #[test]
    fn files_are_found_by_their_usual_paths_and_by_their_own() {
        let card = find(Path::new("models/gyre-255.toml")).unwrap();
        assert_eq!(card, Path::new("gyre:models/gyre-255.toml"));
        let on_disk = Path::new(PROJECT).join("models/gyre-255.toml");
        assert_eq!(bytes(&card).unwrap(), fs::read(on_disk).unwrap());
        let drive = find(Path::new("stop-and-go.tum")).unwrap();
        assert_eq!(drive, Path::new("gyre:configs/stop-and-go.tum"));
        for other in [
            "models/none.toml",
            "/models/gyre-255.toml",
            "../gyre-255.toml",
            "",
        ] {
            assert_eq!(find(Path::new(other)), None, "{other}");
        }
    }

    #[test]
    fn a_configuration_has_a_name_with_and_without_its_ending() {
        let oxford = Some(PathBuf::from("gyre:configs/oxford.toml"));
        assert_eq!(configuration(Path::new("oxford")), oxford);
        assert_eq!(configuration(Path::new("oxford.toml")), oxford);
        assert_eq!(configuration(Path::new("./oxford")), None);
        assert_eq!(configuration(Path::new("stop-and-go.tum")), None);
    }
}
