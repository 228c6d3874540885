//! `pairs.toml`: what `pairs.npy` was made of.

use std::{
    fs,
    path::{Path, PathBuf},
};

use gyre::{Failure, configuration::Configuration};
use gyre_masking::MaskingConfig;
use gyre_radar::{DatasetOptions, Format, RasterConfig};
use gyre_scan_matching::{RotationConfig, TranslationConfig};
use gyre_simulator::SimulationConfig;
use serde::Serialize;

use super::recording::Source;

/// The file's first line; a file with another is somebody else's.
const FIRST_LINE: &str = "# What the .npy file of this name was made of, by gyre export-pairs.\n";

/// Where it is written.
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

/// All that the file depends on.
#[derive(Serialize)]
pub struct Provenance<'a> {
    /// Gyre's.
    pub version: &'static str,
    /// Known where the builder set `GYRE_COMMIT`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub commit: Option<&'static str>,
    /// Records.
    pub scans: usize,
    /// Cells a side of a raster.
    pub n: usize,
    /// Metres a cell.
    pub cell_m: f32,
    pub raster: &'a RasterConfig,
    pub masking: &'a MaskingConfig,
    pub rotation: &'a RotationConfig,
    pub translation: &'a TranslationConfig,
    pub dataset: &'a DatasetOptions,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub simulation: Option<&'a SimulationConfig>,
    pub sequences: &'a [Sequence],
}

/// Scans that follow each other, none left out: those with one number in `sequence`.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Sequence {
    /// The number.
    pub sequence: u32,
    /// Its recording's, or `a simulation`.
    pub name: String,
    /// Its recording's folder as it was named, or `a simulation`.
    pub source: String,
    /// What the recording's files are.
    pub format: Format,
    /// The truth's file.
    pub ground_truth: PathBuf,
    /// The recording's scan that it begins with, from 0.
    pub first_scan: usize,
    /// Its scans.
    pub scans: usize,
}

impl<'a> Provenance<'a> {
    /// Of records made by a configuration.
    pub fn new(configuration: &'a Configuration, sequences: &'a [Sequence]) -> Self {
        Self {
            version: env!("CARGO_PKG_VERSION"),
            commit: option_env!("GYRE_COMMIT"),
            scans: sequences.iter().map(|sequence| sequence.scans).sum(),
            n: configuration.raster.n,
            cell_m: configuration.raster.cell_m,
            raster: &configuration.raster,
            masking: &configuration.masking,
            rotation: &configuration.rotation,
            translation: &configuration.translation,
            dataset: &configuration.dataset,
            simulation: configuration.simulation.as_ref(),
            sequences,
        }
    }

    /// The file's text.
    pub fn to_toml(&self) -> Result<String, toml::ser::Error> {
        Ok(format!("{FIRST_LINE}{}", toml::to_string_pretty(self)?))
    }
}

impl Sequence {
    /// One that begins with a recording's scan `first_scan`, empty.
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
