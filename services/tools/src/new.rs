//! `gyre new`: begins a project.

use std::path::{Path, PathBuf};

use clap::{Args, Subcommand, builder::PossibleValuesParser};
use gyre_configuration::terminal::{Failure, print};
use gyre_contract::run::StageConfig;
use gyre_storage as storage;

/// A kind of project.
#[derive(Debug, Subcommand)]
pub enum New {
    /// A stage of your own, with its test.
    Stage(StageArguments),
}

#[derive(Debug, Args)]
pub struct StageArguments {
    /// The stage that it takes the place of.
    #[arg(value_parser = PossibleValuesParser::new(StageConfig::PYTHON.map(|(stage, _)| stage)))]
    pub stage: String,
    /// The folder of the project. Default: `my-STAGE`.
    pub folder: Option<PathBuf>,
    /// A function in a file of Python.
    #[arg(long, conflicts_with = "rust", required_unless_present = "rust")]
    pub python: bool,
    /// A program in Rust.
    #[arg(long, requires = "gyre")]
    pub rust: bool,
    /// The checkout of Gyre, whose crates a program in Rust depends on.
    #[arg(long, value_name = "CHECKOUT")]
    pub gyre: Option<PathBuf>,
}

pub fn new(what: &New) -> Result<(), Failure> {
    let New::Stage(arguments) = what;
    let stage = arguments.stage.as_str();
    let default = || PathBuf::from(format!("my-{stage}"));
    let folder = arguments.folder.clone().unwrap_or_else(default);
    if folder.exists() {
        return Err(format!("{} exists: name another folder", folder.display()).into());
    }
    let checkout = match &arguments.gyre {
        Some(gyre) => checkout(gyre)?,
        None => PathBuf::new(),
    };
    let function = StageConfig::function(stage)?;
    for (name, text) in files(stage, arguments.rust) {
        let fill_in = |text: &str| {
            text.replace("@stage@", stage)
                .replace("@function@", function)
                .replace("@gyre@", &checkout.display().to_string())
        };
        let path = folder.join(fill_in(name));
        storage::create_folder(path.parent().unwrap_or(&folder))?;
        storage::write(&path, fill_in(text))?;
    }
    let folder = folder.display();
    print::line(format_args!(
        "{folder} has been written: {folder}/README.md lists its commands"
    ))
}

macro_rules! template {
    ($name:literal) => {
        include_str!(concat!("../templates/", $name))
    };
}

fn files(stage: &str, is_rust: bool) -> Vec<(&'static str, &'static str)> {
    if is_rust {
        let text = match stage {
            "rotation-search" => template!("rust/rotation-search.rs"),
            "translation-search" => template!("rust/translation-search.rs"),
            _ => template!("rust/masking.rs"),
        };
        return vec![
            ("Cargo.toml", template!("rust/Cargo.toml.txt")),
            ("src/main.rs", text),
            ("tests/conformance.rs", template!("rust/test.rs")),
            ("README.md", template!("rust/README.md")),
        ];
    }
    let text = match stage {
        "rotation-search" => template!("python/rotation.py"),
        "translation-search" => template!("python/translation.py"),
        _ => template!("python/mask.py"),
    };
    vec![
        ("@function@.py", text),
        ("test_@function@.py", template!("python/test.py")),
        ("README.md", template!("python/README.md")),
    ]
}

fn checkout(folder: &Path) -> Result<PathBuf, Failure> {
    let is_one = folder.join("shared/process/stage/Cargo.toml").is_file();
    match folder.canonicalize() {
        Ok(folder) if is_one => Ok(folder),
        _ => Err(format!("{} is no checkout of Gyre", folder.display()).into()),
    }
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use super::*;

    /// The manifest of a project has the crates that its program names, and no others of Gyre.
    #[test]
    fn a_project_in_rust_depends_on_the_crates_that_the_templates_name() {
        let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
        let manifest = template!("rust/Cargo.toml.txt");
        let programs = [
            template!("rust/masking.rs"),
            template!("rust/rotation-search.rs"),
            template!("rust/translation-search.rs"),
        ];
        let mut dependencies = Vec::new();
        for line in manifest.lines().filter(|line| line.starts_with("gyre-")) {
            let (name, path) = line.split_once(" = { path = \"@gyre@/").unwrap();
            let path = root.join(path.trim_end_matches("\" }")).join("Cargo.toml");
            assert!(path.is_file(), "{}", path.display());
            dependencies.push(name.replace('-', "_"));
        }
        let programs = programs.concat();
        let parts = programs.split(|c: char| !c.is_ascii_lowercase() && c != '_');
        let named: BTreeSet<&str> = parts.filter(|it| it.starts_with("gyre_")).collect();
        dependencies.sort();
        assert!(named.iter().eq(&dependencies), "{named:?} {dependencies:?}");
    }
}
