//! The networks that rows mask with: cards such as `models/f-mbym-255.toml`.

use std::path::{Path, PathBuf};

use gyre_masking::{MaskKind, MaskingConfig, model::Card, network::Network};
use gyre_radar::RasterConfig;

/// A network that can be used.
#[derive(Clone, Debug, PartialEq)]
pub struct Model {
    /// The model card.
    pub card: PathBuf,
    /// Metres a cell of the rasters that it is for.
    pub cell_m: f32,
}

impl Model {
    /// Finds the first of `names` that `folder` has, for rasters of `n` cells a side ({n} in a
    /// name), and of `cell_m` metres a cell where that is settled; `None` without names. The
    /// network has been loaded once.
    ///
    /// # Errors
    /// A sentence that says what is missing or does not fit.
    pub fn find(
        folder: &Path,
        names: &[String],
        n: usize,
        cell_m: Option<f32>,
    ) -> Result<Option<Self>, String> {
        let file = |name: &String| folder.join(name.replace("{n}", &n.to_string()) + ".toml");
        let cards: Vec<PathBuf> = names.iter().map(file).collect();
        let card = match (cards.iter().find(|card| card.exists()), cards.last()) {
            (Some(card), _) => card.clone(),
            (None, Some(missing)) => return Err(format!("there is no {}", missing.display())),
            (None, None) => return Ok(None),
        };
        let masking = MaskingConfig {
            kind: MaskKind::Learned,
            model: Some(card.clone()),
            ..MaskingConfig::default()
        };
        let trained = Card::read(&masking)?;
        let cell_m = cell_m.unwrap_or(trained.raster.cell_m);
        let raster = RasterConfig {
            n,
            cell_m,
            ..RasterConfig::default()
        };
        Network::load(&masking, &raster).map_err(|error| error.to_string())?;
        Ok(Some(Self { card, cell_m }))
    }

    /// The overrides that mask with it.
    pub fn changes(&self) -> [String; 2] {
        [
            "masking.kind=learned".to_owned(),
            format!("masking.model={}", self.card.display()),
        ]
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use std::fs;

    use gyre_configuration::Configuration;
    use gyre_masking::networks::runtime;

    use super::*;

    fn fixtures() -> PathBuf {
        Path::new(env!("CARGO_MANIFEST_DIR")).join("../../shared/method/masking/tests/models")
    }

    fn find(folder: &Path, names: &[&str], n: usize, cell_m: Option<f32>) -> Result<Model, String> {
        let names: Vec<String> = names.iter().map(|name| (*name).to_owned()).collect();
        Ok(Model::find(folder, &names, n, cell_m)?.unwrap())
    }

    #[test]
    fn what_is_missing_or_does_not_fit_is_a_sentence() {
        let folder = tempfile::tempdir().unwrap();
        let reason = find(folder.path(), &["mbym-{n}", "f-mbym-{n}"], 127, None).unwrap_err();
        assert!(
            reason.starts_with("there is no ") && reason.ends_with("/f-mbym-127.toml"),
            "{reason}"
        );
        fs::copy(
            fixtures().join("single-127.toml"),
            folder.path().join("gyre-255.toml"),
        )
        .unwrap();
        let reason = |n, cell_m| find(folder.path(), &["gyre-255"], n, cell_m).unwrap_err();
        assert!(reason(255, None).contains("gyre-255.toml is for 127"));
        assert!(reason(127, Some(0.4)).contains("raster.cell_m is 0.4"));
        assert!(reason(127, None).contains("single-127.onnx"));
    }

    #[test]
    fn a_network_is_found_by_the_first_name_that_is_there() {
        if runtime::find(None).is_err() {
            println!("skipped: ONNX Runtime is not installed");
            return;
        }
        let found = find(&fixtures(), &["double-{n}", "single-{n}"], 127, None).unwrap();
        assert_eq!(found.cell_m, 0.8);
        let masking = Configuration::of_overrides(&found.changes())
            .unwrap()
            .odometry
            .masking;
        assert_eq!(
            (masking.kind, masking.model),
            (MaskKind::Learned, Some(found.card.canonicalize().unwrap()))
        );
    }
}
