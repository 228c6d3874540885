//! The library that computes networks, and the differences from the training of masks.

use std::error::Error;

use gyre_contract::StageId;
use gyre_masking::{
    MaskKind, MaskingConfig,
    model::Card,
    networks::runtime::{INSTALL, RuntimeError},
};
use gyre_matching::odometry::OdometryConfig;

use crate::configuration::Configuration;

/// Returns what [`describe_masks`] does, for a command that masks scans in its own process: it does
/// not call a function of Python.
pub fn describe_masks_in_process(
    configuration: &Configuration,
) -> Result<Vec<String>, Box<dyn Error + Send + Sync>> {
    let mut sentences = describe_masks(configuration)?;
    let stage = configuration.stages.get(StageId::Masking.name());
    if let Some(file) = stage.and_then(|stage| stage.python.as_ref()) {
        sentences.push(format!(
            "the mask of {} is called in runs alone: the threshold masks here",
            file.display()
        ));
    }
    Ok(sentences)
}

/// Returns sentences: which library computes learned masks, and where a configuration differs from
/// the one that its network was trained for. None without learned masks.
pub fn describe_masks(
    configuration: &Configuration,
) -> Result<Vec<String>, Box<dyn Error + Send + Sync>> {
    let OdometryConfig {
        masking, raster, ..
    } = &configuration.odometry;
    let (MaskKind::Learned, Some(card), true) = (
        masking.kind,
        &masking.model,
        configuration.starts(StageId::Masking),
    ) else {
        return Ok(Vec::new());
    };
    let card = card.display();
    let mut sentences = vec![computed(&format!("the masks of {card} are"), masking)?];
    let unlike = Card::read(masking)?.training_mismatches(masking, raster);
    if !unlike.is_empty() {
        sentences.push(format!(
            "the masks of {card} may be less accurate than in training: {}",
            unlike.join(", ")
        ));
    }
    Ok(sentences)
}

/// Returns a sentence: which library computes the network of moving objects. `None` without these.
pub fn describe_objects(
    configuration: &Configuration,
) -> Result<Option<String>, Box<dyn Error + Send + Sync>> {
    let masking = &configuration.odometry.masking;
    let is_on = configuration.objects.is_on();
    Ok(is_on
        .then(|| computed("moving objects are", masking))
        .transpose()?)
}

fn computed(what: &str, masking: &MaskingConfig) -> Result<String, RuntimeError> {
    Ok(match masking.onnx_runtime()? {
        Some(path) => {
            format!("{what} computed by ONNX Runtime, {}", path.display())
        }
        None => format!(
            "{what} computed by rten, in one thread; ONNX Runtime is several times faster: `{INSTALL}` installs it"
        ),
    })
}
