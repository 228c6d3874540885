//! `pairs.toml`: the provenance of `pairs.npy`.

use std::{
    fs,
    path::{Path, PathBuf},
};

use gyre::{Failure, configuration::Configuration};
use gyre_radar::Format;
use serde::Serialize;
use toml::{Table, Value};

use super::recording::Source;

/// The file's first line; a file with another is somebody else's.
const FIRST_LINE: &str = "# What the .npy file of this name was made of, by gyre export-pairs.\n";

/// The sections of the configuration that the records depend on.
const SECTIONS: [&str; 6] = [
    "raster",
    "masking",
    "rotation",
    "translation",
    "dataset",
    "simulation",
];

/// Returns the file beside `pairs`.
pub fn place(pairs: &Path) -> PathBuf {
    pairs.with_extension("toml")
}

/// Refuses a name that is no `.npy` file's, or beside which another file is in the way: a configuration, say.
pub fn check_place(pairs: &Path) -> Result<(), Failure> {
    let named = pairs.display();
    if pairs.extension().is_none_or(|extension| extension != "npy") {
        return Err(format!("--out {named}: the file's name must end in .npy").into());
    }
    let beside = place(pairs);
    match fs::read(&beside) {
        Ok(text) if !text.starts_with(FIRST_LINE.as_bytes()) => Err(format!(
            "{} would be overwritten to say what {named} is made of, but is no export's: choose another --out",
            beside.display()
        )
        .into()),
        _ => Ok(()),
    }
}

/// Scans that follow each other, none left out: those with one number in `sequence`.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Sequence {
    /// The number.
    pub sequence: u32,
    /// The recording's name, or `a simulation`.
    pub name: String,
    /// The recording's folder as it was named, or `a simulation`.
    pub source: String,
    /// The format of the recording.
    pub format: Format,
    /// The truth's file.
    pub ground_truth: PathBuf,
    /// The recording's scan that it begins with, from 0.
    pub first_scan: usize,
    /// The number of scans.
    pub scans: usize,
}

/// Returns the text of the file: all that the records depend on.
///
/// # Errors
/// A value that TOML cannot hold.
pub fn to_toml(configuration: &Configuration, sequences: &[Sequence]) -> Result<String, Failure> {
    // Through text: a table made directly has other digits in its f32 values.
    let mut table: Table = configuration.to_toml()?.parse()?;
    table.retain(|section, _| SECTIONS.contains(&section));
    let scans: usize = sequences.iter().map(|sequence| sequence.scans).sum();
    table.insert("version".to_owned(), env!("CARGO_PKG_VERSION").into());
    table.extend(option_env!("GYRE_COMMIT").map(|commit| ("commit".to_owned(), commit.into())));
    table.insert("scans".to_owned(), Value::try_from(scans)?);
    table.insert(
        "n".to_owned(),
        Value::try_from(configuration.odometry.raster.n)?,
    );
    table.insert("sequences".to_owned(), Value::try_from(sequences)?);
    Ok(format!("{FIRST_LINE}{}", toml::to_string_pretty(&table)?))
}

impl Sequence {
    /// Starts with a recording's scan `first_scan`, without scans.
    pub fn new(sequence: u32, source: &Source, first_scan: usize) -> Self {
        Self {
            sequence,
            name: source.name(),
            source: source.data.clone(),
            format: source.format,
            ground_truth: source.truth.path.clone(),
            first_scan,
            scans: 0,
        }
    }
}
