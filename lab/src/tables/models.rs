//! The networks that rows mask with: `models/f-mbym-255.toml` and the like, each with the reason where it cannot be used.

use std::{
    fmt,
    path::{Path, PathBuf},
};

use gyre_masking::{MaskKind, MaskingConfig, model::Card, network::Network};
use gyre_radar::RasterConfig;
use serde::{Serialize, Serializer};

/// The network that Gyre masks with unless told otherwise.
pub const PRODUCT: &str = "gyre-255";

/// Which network a row masks with.
#[derive(Debug, PartialEq, Eq)]
pub enum Mask {
    /// [`PRODUCT`], for the one size of raster that it is for.
    Product,
    /// `NAME-N` for rasters of N cells a side, by the first of these names of which there is one.
    OfSize(&'static [&'static str]),
}

/// Where the networks are.
#[derive(Debug)]
pub struct Models {
    folder: PathBuf,
}

/// A network that can be used.
#[derive(Clone, Debug, PartialEq)]
pub struct Model {
    /// Its card.
    pub card: PathBuf,
    /// Metres a cell of the rasters that it is for.
    pub cell_m: f32,
    /// The card of the one that it stands in for.
    pub instead_of: Option<PathBuf>,
}

impl Models {
    /// Those in a folder.
    pub fn new(folder: &Path) -> Self {
        Self {
            folder: folder.to_owned(),
        }
    }

    /// The network for rasters of `n` cells a side, and of `cell_m` metres a cell where that is settled. It has been loaded once.
    ///
    /// # Errors
    /// What is missing or does not fit, as a sentence.
    pub fn find(&self, mask: &Mask, n: usize, cell_m: Option<f32>) -> Result<Model, String> {
        let cards = match mask {
            Mask::Product => vec![self.folder.join(PRODUCT)],
            Mask::OfSize(names) => names
                .iter()
                .map(|name| self.folder.join(format!("{name}-{n}")))
                .collect(),
        };
        let cards: Vec<PathBuf> = cards
            .into_iter()
            .map(|card| card.with_extension("toml"))
            .collect();
        let there = cards.iter().find(|card| card.exists());
        let card =
            there.ok_or_else(|| format!("there is no {}", cards[cards.len() - 1].display()))?;
        let masking = MaskingConfig {
            kind: MaskKind::Learned,
            model: Some(card.clone()),
            ..MaskingConfig::default()
        };
        let trained = Card::read(&masking)
            .map_err(|error| error.to_string())?
            .raster;
        let raster = RasterConfig {
            n,
            cell_m: cell_m.unwrap_or(trained.cell_m),
            ..RasterConfig::default()
        };
        Network::load(&masking, &raster).map_err(|error| error.to_string())?;
        let instead_of = (card != &cards[0]).then(|| cards[0].clone());
        Ok(Model {
            card: card.clone(),
            cell_m: raster.cell_m,
            instead_of,
        })
    }
}

impl Model {
    /// The `--set` sentences that mask with it.
    pub fn changes(&self) -> [String; 2] {
        [
            "masking.kind=learned".to_owned(),
            format!("masking.model={}", self.card.display()),
        ]
    }
}

impl fmt::Display for Model {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}", self.card.display())?;
        match &self.instead_of {
            Some(other) => write!(f, " (there is no {})", other.display()),
            None => Ok(()),
        }
    }
}

impl Serialize for Model {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_str(self)
    }
}

/// Rows that share a reason why they are left out, or a network.
#[derive(Debug, PartialEq, Eq, Serialize)]
pub struct Note {
    /// The reason, or the network.
    pub what: String,
    /// Their names.
    pub rows: Vec<String>,
}

/// Adds a row to the note that says the same, or a note.
pub fn note(notes: &mut Vec<Note>, what: String, row: String) {
    match notes.iter_mut().find(|note| note.what == what) {
        Some(note) => note.rows.push(row),
        None => notes.push(Note {
            what,
            rows: vec![row],
        }),
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use std::fs;

    use gyre_masking::runtime;

    use super::*;
    use gyre::configuration::Configuration;

    fn fixtures() -> PathBuf {
        Path::new(env!("CARGO_MANIFEST_DIR")).join("../services/masking/tests/models")
    }

    #[test]
    fn what_is_missing_or_does_not_fit_is_a_sentence() {
        let folder = tempfile::tempdir().unwrap();
        let models = Models::new(folder.path());
        let reason = models
            .find(&Mask::OfSize(&["mbym", "f-mbym"]), 127, None)
            .unwrap_err();
        assert!(
            reason.starts_with("there is no ") && reason.ends_with("/f-mbym-127.toml"),
            "{reason}"
        );
        fs::copy(
            fixtures().join("single-127.toml"),
            folder.path().join("gyre-255.toml"),
        )
        .unwrap();
        let reason = models.find(&Mask::Product, 255, None).unwrap_err();
        assert!(reason.contains("gyre-255.toml is for 127"), "{reason}");
        let reason = models.find(&Mask::Product, 127, Some(0.4)).unwrap_err();
        assert!(reason.contains("raster.cell_m is 0.4"), "{reason}");
        let reason = models.find(&Mask::Product, 127, None).unwrap_err();
        assert!(reason.contains("single-127.onnx"), "{reason}");
    }

    #[test]
    fn a_network_is_found_by_the_first_name_that_is_there() {
        if runtime::find(None).is_err() {
            println!("skipped: ONNX Runtime is not installed");
            return;
        }
        let models = Models::new(&fixtures());
        let mut found = models
            .find(&Mask::OfSize(&["double", "single"]), 127, None)
            .unwrap();
        assert_eq!(found.cell_m, 0.8);
        let told = found.to_string();
        assert!(
            told.contains("single-127.toml (there is no ") && told.ends_with("double-127.toml)"),
            "{told}"
        );
        found.card = PathBuf::from("2019-01-10.toml");
        let masking = Configuration::of_overrides(&found.changes())
            .unwrap()
            .masking;
        assert_eq!(
            (masking.kind, masking.model),
            (MaskKind::Learned, Some(found.card))
        );
        assert_eq!(
            models
                .find(&Mask::OfSize(&["single"]), 127, Some(0.8))
                .unwrap()
                .instead_of,
            None
        );
    }

    #[test]
    fn rows_with_the_same_reason_share_a_note() {
        let mut notes = Vec::new();
        for (what, row) in [("none", "a"), ("old", "b"), ("none", "c")] {
            note(&mut notes, what.to_owned(), row.to_owned());
        }
        let [first, second] = &notes[..] else {
            panic!("{notes:?}")
        };
        assert_eq!(
            (first.rows.join(" "), second.rows.join(" ")),
            ("a c".to_owned(), "b".to_owned())
        );
    }
}
