//! `gyre new`: begins a project.

use std::{
    fs,
    path::{Path, PathBuf},
    process::ExitCode,
};

use clap::{Args, Subcommand, builder::PossibleValuesParser};
use gyre_run::StageConfig;
use gyre_terminal::{Failure, print};

/// The arguments of `gyre new`.
#[derive(Debug, Args)]
pub struct NewArguments {
    /// The kind of project.
    #[command(subcommand)]
    pub what: New,
}

/// A kind of project.
#[derive(Debug, Subcommand)]
pub enum New {
    /// A stage of your own, with its test.
    Stage(StageArguments),
}

/// The arguments of `gyre new stage`.
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

/// A file of a project: its name and its text.
type File = (&'static str, &'static str);

pub fn new(arguments: &NewArguments) -> Result<ExitCode, Failure> {
    let New::Stage(arguments) = &arguments.what;
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
    let files = match arguments.rust {
        true => rust(stage),
        false => python(stage),
    };
    for (name, text) in files {
        let fill_in = |text: &str| {
            text.replace("@stage@", stage)
                .replace("@function@", function)
                .replace("@gyre@", &checkout.display().to_string())
        };
        write(&folder.join(fill_in(name)), &fill_in(text))?;
    }
    let folder = folder.display();
    print::line(format_args!(
        "{folder} is begun: {folder}/README.md says how it is tried"
    ))?;
    Ok(ExitCode::SUCCESS)
}

fn python(stage: &str) -> Vec<File> {
    let text = match stage {
        "rotation-search" => include_str!("../templates/python/rotation.py"),
        "translation-search" => include_str!("../templates/python/translation.py"),
        _ => include_str!("../templates/python/mask.py"),
    };
    vec![
        ("@function@.py", text),
        (
            "test_@function@.py",
            include_str!("../templates/python/test.py"),
        ),
        ("README.md", include_str!("../templates/python/README.md")),
    ]
}

fn rust(stage: &str) -> Vec<File> {
    let text = match stage {
        "rotation-search" => include_str!("../templates/rust/rotation-search.rs"),
        "translation-search" => include_str!("../templates/rust/translation-search.rs"),
        _ => include_str!("../templates/rust/masking.rs"),
    };
    vec![
        (
            "Cargo.toml",
            include_str!("../templates/rust/Cargo.toml.txt"),
        ),
        ("src/main.rs", text),
        (
            "tests/conformance.rs",
            include_str!("../templates/rust/test.rs"),
        ),
        ("README.md", include_str!("../templates/rust/README.md")),
    ]
}

/// Returns the whole path of a checkout of Gyre.
fn checkout(folder: &Path) -> Result<PathBuf, Failure> {
    let is_one = folder.join("shared/process/stage/Cargo.toml").is_file();
    match folder.canonicalize() {
        Ok(folder) if is_one => Ok(folder),
        _ => Err(format!("{} is no checkout of Gyre", folder.display()).into()),
    }
}

fn write(path: &Path, text: &str) -> Result<(), Failure> {
    let folder = path.parent().unwrap_or(path);
    fs::create_dir_all(folder)
        .and_then(|()| fs::write(path, text))
        .map_err(|error| format!("cannot write {}: {error}", path.display()).into())
}
