//! `pairs.toml`: what `pairs.npy` was made of.

use std::path::PathBuf;

use gyre_masking::MaskingConfig;
use gyre_radar::{DatasetOptions, Format, RasterConfig};
use gyre_scan_matching::{RotationConfig, TranslationConfig};
use gyre_simulator::SimulationConfig;
use serde::Serialize;

use super::recordings::Recording;
use crate::configuration::Configuration;

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
}

impl Sequence {
    /// One that begins with a recording's scan `first_scan`, empty.
    pub fn new(sequence: u32, recording: &Recording, first_scan: usize) -> Self {
        Self {
            sequence,
            name: recording.name(),
            source: recording.data.clone(),
            format: recording.dataset.format(),
            ground_truth: recording.truth.path.clone(),
            first_scan,
            scans: 0,
        }
    }
}
