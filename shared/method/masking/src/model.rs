//! A model and its card, which states the model's file and the rasters that it was trained on.

use std::{
    fmt, io,
    path::{Path, PathBuf},
};

use gyre_radar::{RasterConfig, Sampling};
use gyre_storage::quoted;
use serde::Deserialize;
use sha2::{Digest, Sha256};
use thiserror::Error;

use crate::{MaskingConfig, external::external_file};

/// The size limit of models: hundreds of times a mask's.
const MAX_BYTES: u64 = 1 << 30;

/// The card of a model (`NAME.toml`). It may have other sections, on the provenance of the model.
#[derive(Clone, Debug, PartialEq, Deserialize)]
pub struct Card {
    pub model: NetworkFacts,
    /// The rasters that it was trained on.
    pub raster: RasterFacts,
    /// The processing of these rasters; optional.
    #[serde(default)]
    pub masking: MaskingFacts,
}

#[derive(Clone, Debug, PartialEq, Deserialize)]
pub struct NetworkFacts {
    /// The model's file, in the folder of the card.
    pub file: PathBuf,
    /// SHA-256 of the file, hexadecimal.
    pub sha256: String,
    pub inputs: usize,
    pub opset: u32,
}

/// The section `[raster]` of a card.
#[derive(Clone, Debug, PartialEq, Deserialize)]
pub struct RasterFacts {
    pub n: usize,
    pub cell_m: f32,
    pub sampling: Option<Sampling>,
    /// Ranges below this are left out, m.
    pub min_range_m: Option<f32>,
    /// Width of the average of [`Sampling::Averaged`], in cells.
    pub averaged_cells: Option<f32>,
}

/// The section `[masking]` of a card: the processing of a raster before the network.
#[derive(Clone, Debug, Default, PartialEq, Deserialize)]
pub struct MaskingFacts {
    /// The highest power that was set to zero.
    pub floor: Option<u8>,
    /// True if rasters were motion-compensated.
    pub compensate: Option<bool>,
    /// True if the Doppler shift of ranges was compensated.
    pub undo_doppler: Option<bool>,
}

/// A model with a verified checksum and a card that fits the run.
#[derive(Debug)]
pub struct Model {
    pub card: Card,
    pub file: PathBuf,
    /// The content of the file.
    pub bytes: Vec<u8>,
}

#[derive(Debug, Error)]
pub enum ModelError {
    #[error(
        "masking.kind is `learned`, but masking.model does not name a model: set it to the card of one, as in models/NAME.toml"
    )]
    NotNamed,
    #[error("cannot read the model's {what} {path}: {source}")]
    Unreadable {
        what: &'static str,
        path: PathBuf,
        source: io::Error,
    },
    #[error("masking.model is {path}, which is not the card of a model: {reason}")]
    NotACard { path: PathBuf, reason: String },
    #[error(
        "{path} has the SHA-256 {actual}, but its card says {expected}: it is damaged or another model's, so get it again together with its card"
    )]
    Checksum {
        /// The model's file.
        path: PathBuf,
        /// The value of the card.
        expected: String,
        actual: String,
    },
    /// The file keeps weights in another file, which no checksum covers.
    #[error(
        "{path} keeps weights in another file, {}, which the SHA-256 of its card does not cover: write them into it, in Python by \
         `onnx.save(onnx.load(NAME), NAME)` of the package onnx, and its new SHA-256 into the card",
        quoted(.file)
    )]
    External {
        /// The model's file.
        path: PathBuf,
        /// The name of the other file.
        file: String,
    },
    #[error(
        "masking.sha256 is {expected}, but {path} is the card of a model with {actual}: name the other model, or leave masking.sha256 out"
    )]
    OtherModel {
        path: PathBuf,
        expected: String,
        actual: String,
    },
    #[error(
        "raster.{key} is {actual}, but the model {path} is for {expected}: set raster.{key} = {expected}, or choose another masking.model"
    )]
    Raster {
        key: &'static str,
        path: PathBuf,
        expected: f64,
        actual: f64,
    },
}

impl Card {
    /// Reads the card that `masking.model` names.
    pub fn read(config: &MaskingConfig) -> Result<Self, ModelError> {
        let path = config.model.as_deref().ok_or(ModelError::NotNamed)?;
        let not_a_card = |reason: String| ModelError::NotACard {
            path: path.to_owned(),
            reason,
        };
        if path
            .extension()
            .is_some_and(|extension| extension == "onnx")
        {
            return Err(not_a_card(
                "it is the model itself; its card is the .toml beside it".to_owned(),
            ));
        }
        let unreadable = |source| ModelError::Unreadable {
            what: "card",
            path: path.to_owned(),
            source,
        };
        let text = match gyre_shipped::text(path) {
            Some(text) => text.to_owned(),
            None => gyre_storage::read_text(path, gyre_storage::SETTINGS).map_err(unreadable)?,
        };
        let card: Self = toml::from_str(&text)
            .map_err(|error| not_a_card(error.message().trim().replace('\n', "; ")))?;
        if !(1..=2).contains(&card.model.inputs) {
            return Err(not_a_card(format!(
                "model.inputs is {}, but must be 1 or 2",
                card.model.inputs
            )));
        }
        if !is_sha256(&card.model.sha256) {
            let reason = "model.sha256 is not 64 hexadecimal digits";
            return Err(not_a_card(reason.to_owned()));
        }
        if !is_plain_name(&card.model.file) {
            return Err(not_a_card(format!(
                "model.file is {:?}, but must name a file in the folder of the card",
                card.model.file
            )));
        }
        match &config.sha256 {
            Some(expected) if !expected.eq_ignore_ascii_case(&card.model.sha256) => {
                Err(ModelError::OtherModel {
                    path: path.to_owned(),
                    expected: expected.clone(),
                    actual: card.model.sha256,
                })
            }
            _ => Ok(card),
        }
    }

    /// Returns the settings that differ from those in training. The network runs, but its masks are
    /// less accurate.
    pub fn training_mismatches(
        &self,
        masking: &MaskingConfig,
        raster: &RasterConfig,
    ) -> Vec<String> {
        let averaged = raster.sampling == Sampling::Averaged;
        let differences = [
            mismatch("masking.threshold", self.masking.floor, masking.floor()),
            mismatch(
                "masking.compensate",
                self.masking.compensate,
                masking.compensate,
            ),
            mismatch(
                "masking.undo_doppler",
                self.masking.undo_doppler,
                masking.undo_doppler,
            ),
            mismatch(
                "raster.min_range_m",
                self.raster.min_range_m,
                raster.min_range_m,
            ),
            mismatch("raster.sampling", self.raster.sampling, raster.sampling),
            averaged
                .then(|| {
                    mismatch(
                        "raster.averaged_cells",
                        self.raster.averaged_cells,
                        raster.averaged_cells,
                    )
                })
                .flatten(),
        ];
        differences.into_iter().flatten().collect()
    }
}

fn is_sha256(text: &str) -> bool {
    text.len() == 64 && text.bytes().all(|digit| digit.is_ascii_hexdigit())
}

/// Returns whether a path is the name of a file, without folders, that can be printed.
fn is_plain_name(path: &Path) -> bool {
    let is_printable = |name: &str| !name.contains(char::is_control);
    path.file_name() == Some(path.as_os_str()) && path.to_str().is_some_and(is_printable)
}

fn mismatch<T: PartialEq + fmt::Display>(key: &str, trained: Option<T>, here: T) -> Option<String> {
    trained
        .filter(|trained| *trained != here)
        .map(|trained| format!("{key} is {here} instead of {trained}"))
}

impl Model {
    /// Reads the model that `masking.model` names and checks that it fits these rasters.
    pub fn read(config: &MaskingConfig, raster: &RasterConfig) -> Result<Self, ModelError> {
        let card = Card::read(config)?;
        let path = config.model.as_deref().ok_or(ModelError::NotNamed)?;
        check_raster(path, &card.raster, raster)?;
        let file = path.with_file_name(&card.model.file);
        let unreadable = |source| ModelError::Unreadable {
            what: "file",
            path: file.clone(),
            source,
        };
        let bytes = match gyre_shipped::bytes(&file) {
            Some(bytes) => bytes.to_owned(),
            None => gyre_storage::read_bytes(&file, MAX_BYTES).map_err(unreadable)?,
        };
        let actual = hexadecimal(&Sha256::digest(&bytes));
        if !actual.eq_ignore_ascii_case(&card.model.sha256) {
            return Err(ModelError::Checksum {
                path: file,
                expected: card.model.sha256,
                actual,
            });
        }
        match external_file(&bytes) {
            None => Ok(Self { card, file, bytes }),
            Some(other) => Err(ModelError::External {
                path: file,
                file: other,
            }),
        }
    }
}

fn check_raster(
    path: &Path,
    trained: &RasterFacts,
    raster: &RasterConfig,
) -> Result<(), ModelError> {
    let differs = |key, expected: f64, actual: f64| ModelError::Raster {
        key,
        path: path.to_owned(),
        expected,
        actual,
    };
    if trained.n != raster.n {
        return Err(differs("n", trained.n as f64, raster.n as f64));
    }
    match (trained.cell_m - raster.cell_m).abs() <= 1e-4 * trained.cell_m {
        true => Ok(()),
        false => Err(differs(
            "cell_m",
            shortest_decimal(trained.cell_m),
            shortest_decimal(raster.cell_m),
        )),
    }
}

/// Converts without the digits that an `f32` gains as `f64`: 0.8, not 0.800000011920929.
fn shortest_decimal(value: f32) -> f64 {
    value.to_string().parse().unwrap_or(value.into())
}

fn hexadecimal(bytes: &[u8]) -> String {
    bytes.iter().map(|byte| format!("{byte:02x}")).collect()
}
