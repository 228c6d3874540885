//! The models of `models/`: their files have the checksums of their cards, and ONNX Runtime loads them.

#![allow(clippy::unwrap_used)]

mod common;

use std::{
    fs,
    path::{Path, PathBuf},
};

use common::{learned, runtime_is_installed};
use gyre_masking::{
    model::{Card, Model},
    network::Network,
};
use gyre_radar::RasterConfig;
use ndarray::Array3;

fn cards() -> Vec<PathBuf> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../models");
    let files = fs::read_dir(folder)
        .unwrap()
        .map(|file| file.unwrap().path());
    files
        .filter(|file| {
            file.extension()
                .is_some_and(|extension| extension == "toml")
        })
        .collect()
}

#[test]
fn every_card_fits_its_model() {
    let cards = cards();
    assert!(cards.len() >= 4, "{cards:?}");
    for path in cards {
        let config = learned(&path);
        let Card {
            raster: trained, ..
        } = Card::read(&config).unwrap();
        let raster = RasterConfig {
            n: trained.n,
            cell_m: trained.cell_m,
            ..RasterConfig::default()
        };
        let bytes = Model::read(&config, &raster).unwrap().bytes.len();
        assert!(bytes < 9_000_000, "{}: {bytes} bytes", path.display());
        if runtime_is_installed() {
            let mut network = Network::load(&config, &raster).unwrap();
            let bright = Array3::from_elem((network.scans(), raster.n, raster.n), 255.0);
            assert_eq!(network.run(bright.view()).unwrap().dim(), bright.dim());
        }
    }
}
