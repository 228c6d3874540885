//! A model and its card: which file, for which rasters, made how.

use std::{
    fmt, fs, io,
    path::{Path, PathBuf},
};

use gyre_radar::{RasterConfig, Sampling};
use serde::Deserialize;
use sha2::{Digest, Sha256};
use thiserror::Error;

use crate::MaskingConfig;

/// What a model's card (`NAME.toml`) says of it. It may have other sections, on where the model comes from.
#[derive(Clone, Debug, PartialEq, Deserialize)]
pub struct Card {
    /// The network.
    pub model: NetworkFacts,
    /// The rasters that it was trained on.
    pub raster: RasterFacts,
    /// How they came about. A card may leave it open.
    #[serde(default)]
    pub masking: MaskingFacts,
}

/// The section `[model]` of a card.
#[derive(Clone, Debug, PartialEq, Deserialize)]
pub struct NetworkFacts {
    /// Its file, in the card's folder.
    pub file: PathBuf,
    /// The file's SHA-256, hexadecimal.
    pub sha256: String,
    /// Scans that it looks at: 1, or 2 (this one and the one before).
    pub inputs: usize,
    /// Version of the operators.
    pub opset: u32,
}

/// The section `[raster]` of a card.
#[derive(Clone, Debug, PartialEq, Deserialize)]
pub struct RasterFacts {
    /// Cells a side.
    pub n: usize,
    /// Metres a cell.
    pub cell_m: f32,
    /// How a cell's value came from the bins.
    pub sampling: Option<Sampling>,
    /// Metres around the radar that were left out.
    pub min_range_m: Option<f32>,
    /// Width, in cells, of what [`Sampling::Averaged`] averaged over.
    pub averaged_cells: Option<f32>,
}

/// The section `[masking]` of a card: what was done before the network looked at a raster.
#[derive(Clone, Debug, Default, PartialEq, Deserialize)]
pub struct MaskingFacts {
    /// Power that counted as nothing.
    pub floor: Option<u8>,
    /// Whether the sweep's distortion was undone.
    pub compensate: Option<bool>,
    /// Whether Doppler's shift of ranges was undone.
    pub undo_doppler: Option<bool>,
}

/// A model whose file is as its card says, and whose card suits the run.
#[derive(Debug)]
pub struct Model {
    /// What its card says.
    pub card: Card,
    /// Its file.
    pub file: PathBuf,
    /// What is in it.
    pub bytes: Vec<u8>,
}

/// Why a model is refused.
#[derive(Debug, Error)]
pub enum ModelError {
    /// None is named.
    #[error(
        "masking.kind is `learned`, but masking.model does not name a model: set it to the card of one, as in models/NAME.toml"
    )]
    NotNamed,
    /// A file cannot be read.
    #[error("cannot read the model's {what} {path}: {source}")]
    Unreadable {
        /// `card` or `file`.
        what: &'static str,
        /// Which file.
        path: PathBuf,
        /// What the operating system said.
        source: io::Error,
    },
    /// The card is none.
    #[error("masking.model is {path}, which is not the card of a model: {reason}")]
    NotACard {
        /// Which file.
        path: PathBuf,
        /// What is wrong with it.
        reason: String,
    },
    /// The file is not the one that the card is about.
    #[error(
        "{path} has the SHA-256 {actual}, but its card says {expected}: it is damaged or another model's, so get it again together with its card"
    )]
    Checksum {
        /// The model's file.
        path: PathBuf,
        /// What the card says.
        expected: String,
        /// What it is.
        actual: String,
    },
    /// The card is not the one that the run began with.
    #[error(
        "masking.sha256 is {expected}, but {path} is the card of a model with {actual}: name the other model, or leave masking.sha256 out"
    )]
    OtherModel {
        /// The card.
        path: PathBuf,
        /// What the configuration says.
        expected: String,
        /// What the card says.
        actual: String,
    },
    /// The rasters have other sizes than those that it was trained on.
    #[error(
        "raster.{key} is {actual}, but the model {path} is for {expected}: set raster.{key} = {expected}, or choose another masking.model"
    )]
    Raster {
        /// Which key of the section `[raster]`.
        key: &'static str,
        /// The card.
        path: PathBuf,
        /// What the card says.
        expected: f64,
        /// What the configuration says.
        actual: f64,
    },
}

impl Card {
    /// Reads the card that `masking.model` names.
    ///
    /// # Errors
    /// None is named; the file cannot be read, is no card, or is that of another model than `masking.sha256` says.
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
        let text = fs::read_to_string(path).map_err(unreadable)?;
        let card: Self = toml::from_str(&text)
            .map_err(|error| not_a_card(error.message().trim().replace('\n', "; ")))?;
        if !(1..=2).contains(&card.model.inputs) {
            return Err(not_a_card(format!(
                "model.inputs is {}, but must be 1 or 2",
                card.model.inputs
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
}

impl Card {
    /// What the network was not trained for, though it runs: its masks are worth less then.
    pub fn unlike_training(&self, masking: &MaskingConfig, raster: &RasterConfig) -> Vec<String> {
        let averaged = raster.sampling == Sampling::Averaged;
        let differences = [
            unlike("masking.threshold", self.masking.floor, masking.floor()),
            unlike(
                "masking.compensate",
                self.masking.compensate,
                masking.compensate,
            ),
            unlike(
                "masking.undo_doppler",
                self.masking.undo_doppler,
                masking.undo_doppler,
            ),
            unlike(
                "raster.min_range_m",
                self.raster.min_range_m,
                raster.min_range_m,
            ),
            unlike("raster.sampling", self.raster.sampling, raster.sampling),
            averaged
                .then(|| {
                    unlike(
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

fn unlike<T: PartialEq + fmt::Display>(key: &str, trained: Option<T>, here: T) -> Option<String> {
    trained
        .filter(|trained| *trained != here)
        .map(|trained| format!("{key} is {here} instead of {trained}"))
}

impl Model {
    /// Reads the model that `masking.model` names, for these rasters.
    ///
    /// # Errors
    /// See [`Card::read`]; besides, rasters of another size, and a file that is not the card's.
    pub fn read(config: &MaskingConfig, raster: &RasterConfig) -> Result<Self, ModelError> {
        let card = Card::read(config)?;
        let path = config.model.as_deref().ok_or(ModelError::NotNamed)?;
        check_raster(path, &card.raster, raster)?;
        let file = path.with_file_name(&card.model.file);
        let bytes = fs::read(&file).map_err(|source| ModelError::Unreadable {
            what: "file",
            path: file.clone(),
            source,
        })?;
        let actual = hexadecimal(&Sha256::digest(&bytes));
        match actual.eq_ignore_ascii_case(&card.model.sha256) {
            true => Ok(Self { card, file, bytes }),
            false => Err(ModelError::Checksum {
                path: file,
                expected: card.model.sha256,
                actual,
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
            as_written(trained.cell_m),
            as_written(raster.cell_m),
        )),
    }
}

/// The number as people write it: not 0.800000011920929 for 0.8.
fn as_written(value: f32) -> f64 {
    value.to_string().parse().unwrap_or(value.into())
}

fn hexadecimal(bytes: &[u8]) -> String {
    bytes.iter().map(|byte| format!("{byte:02x}")).collect()
}
