//! A model and its card, which states the model's file and the rasters that it was trained on.

use std::{
    fmt,
    path::{Path, PathBuf},
};

use gyre_radar::{RasterConfig, Sampling};
use serde::Deserialize;
use sha2::{Digest, Sha256};

use crate::MaskingConfig;

/// The size limit of models: hundreds of times a mask's.
const MAX_BYTES: u64 = 1 << 30;

/// The card of a model (`NAME.toml`). It may have other sections, on the provenance of the model.
#[derive(Clone, Debug, PartialEq, Deserialize)]
pub struct Card {
    pub model: NetworkFacts,
    pub raster: RasterFacts,
    #[serde(default)]
    pub masking: MaskingFacts,
}

#[derive(Clone, Debug, PartialEq, Deserialize)]
pub struct NetworkFacts {
    /// The model's file, in the folder of the card.
    pub file: PathBuf,
    pub sha256: String,
    pub inputs: usize,
    pub opset: u32,
}

#[derive(Clone, Debug, PartialEq, Deserialize)]
pub struct RasterFacts {
    pub n: usize,
    pub cell_m: f32,
    pub sampling: Option<Sampling>,
    pub min_range_m: Option<f32>,
}

/// The section `[masking]` of a card: the processing of a raster before the network.
#[derive(Clone, Debug, Default, PartialEq, Deserialize)]
pub struct MaskingFacts {
    /// The highest power that was set to zero.
    pub floor: Option<u8>,
    pub compensate: Option<bool>,
    pub undo_doppler: Option<bool>,
}

#[derive(Debug)]
pub struct Model {
    pub card: Card,
    pub file: PathBuf,
    pub bytes: Vec<u8>,
}

impl Card {
    pub fn read(config: &MaskingConfig) -> Result<Self, String> {
        let (_, card) = Self::named(config)?;
        Ok(card)
    }

    fn named(config: &MaskingConfig) -> Result<(&Path, Self), String> {
        let path = config.model.as_deref().ok_or(
            "masking.kind is `learned`, but masking.model does not name a model: set it to the card of one, as in models/NAME.toml",
        )?;
        let shown = path.display();
        let not_a_card = |reason: fmt::Arguments<'_>| {
            format!("masking.model is {shown}, which is not the card of a model: {reason}")
        };
        if path.extension().is_some_and(|it| it == "onnx") {
            return Err(not_a_card(format_args!(
                "it is the model itself; its card is the .toml beside it"
            )));
        }
        let text = match gyre_storage::shipped::text(path) {
            Some(text) => text.to_owned(),
            None => gyre_storage::read_text(path, gyre_storage::SETTINGS)
                .map_err(|error| format!("cannot read the model's card {shown}: {error}"))?,
        };
        let card: Self = toml::from_str(&text).map_err(|error| {
            let reason = error.message().trim().replace('\n', "; ");
            not_a_card(format_args!("{reason}"))
        })?;
        let NetworkFacts {
            inputs,
            file,
            sha256,
            ..
        } = &card.model;
        if !(1..=2).contains(inputs) {
            return Err(not_a_card(format_args!(
                "model.inputs is {inputs}, but must be 1 or 2"
            )));
        }
        if !is_sha256(sha256) {
            return Err(not_a_card(format_args!(
                "model.sha256 is not 64 hexadecimal digits"
            )));
        }
        if !is_plain_name(file) {
            return Err(not_a_card(format_args!(
                "model.file is {file:?}, but must name a file in the folder of the card"
            )));
        }
        match &config.sha256 {
            Some(expected) if !expected.eq_ignore_ascii_case(sha256) => Err(format!(
                "masking.sha256 is {expected}, but {shown} is the card of a model with {sha256}: name the other model, or leave masking.sha256 out"
            )),
            _ => Ok((path, card)),
        }
    }

    /// Returns the settings that differ from those in training. The network runs, but its masks are
    /// less accurate.
    pub fn training_mismatches(
        &self,
        masking: &MaskingConfig,
        raster: &RasterConfig,
    ) -> Vec<String> {
        let (trained, trained_mask) = (&self.raster, &self.masking);
        let differences = [
            mismatch("masking.threshold", trained_mask.floor, masking.floor()),
            mismatch(
                "masking.compensate",
                trained_mask.compensate,
                masking.compensate,
            ),
            mismatch(
                "masking.undo_doppler",
                trained_mask.undo_doppler,
                masking.undo_doppler,
            ),
            mismatch(
                "raster.min_range_m",
                trained.min_range_m,
                raster.min_range_m,
            ),
            mismatch("raster.sampling", trained.sampling, raster.sampling),
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
    pub fn read(config: &MaskingConfig, raster: &RasterConfig) -> Result<Self, String> {
        let (path, card) = Card::named(config)?;
        check_raster(path, &card.raster, raster)?;
        let file = path.with_file_name(&card.model.file);
        let shown = file.display();
        let bytes = match gyre_storage::shipped::bytes(&file) {
            Some(bytes) => bytes.to_owned(),
            None => gyre_storage::read_bytes(&file, MAX_BYTES)
                .map_err(|error| format!("cannot read the model's file {shown}: {error}"))?,
        };
        let (expected, actual) = (&card.model.sha256, format!("{:x}", Sha256::digest(&bytes)));
        if !actual.eq_ignore_ascii_case(expected) {
            return Err(format!(
                "{shown} has the SHA-256 {actual}, but its card has {expected}: it is damaged or belongs to a different model, so get it again together with its card"
            ));
        }
        match names_a_file(&bytes) {
            false => Ok(Self { card, file, bytes }),
            // No checksum covers the other file.
            true => Err(format!(
                "{shown} keeps weights in another file, which the SHA-256 of its card does not cover: write them into it, in Python by \
                 `onnx.save(onnx.load(NAME), NAME)` of the package onnx, and its new SHA-256 into the card; if none are there, it calls something else `location`: rename that"
            )),
        }
    }
}

fn check_raster(path: &Path, trained: &RasterFacts, raster: &RasterConfig) -> Result<(), String> {
    let differs = |key: &str, expected: &dyn fmt::Display, actual: &dyn fmt::Display| {
        let path = path.display();
        Err(format!(
            "raster.{key} is {actual}, but the model {path} is for {expected}: set raster.{key} = {expected}, or choose another masking.model"
        ))
    };
    if trained.n != raster.n {
        return differs("n", &trained.n, &raster.n);
    }
    match (trained.cell_m - raster.cell_m).abs() <= 1e-4 * trained.cell_m {
        true => Ok(()),
        false => differs("cell_m", &trained.cell_m, &raster.cell_m),
    }
}

/// Returns whether a model keeps a tensor in another file. Wherever it is in an ONNX file, it has
/// the key `location`, a text of eight bytes: the length is the byte before it, or ends there with
/// a zero. A model that calls anything else so is refused too.
fn names_a_file(model: &[u8]) -> bool {
    let mut texts = model.windows(9);
    texts.any(|text| matches!(text[0], 0 | 8) && text.ends_with(b"location"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_tensor_in_another_file_is_found_however_its_length_is_written() {
        assert!(names_a_file(b"j\x14\x0a\x08location\x12\x06m.data"));
        assert!(names_a_file(b"j\x16\x0a\x88\x80\x00location\x12\x06m.data"));
        assert!(!names_a_file(b"\x0a\x0aallocation") && !names_a_file(b"no model"));
    }
}
