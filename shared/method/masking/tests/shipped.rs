//! The models of `models/`: their files have the checksums of their cards, and all backends load
//! them and agree.

use std::{
    fs,
    path::{Path, PathBuf},
};

use crate::common::{backends, learned, learned_by, runtime_is_installed, sweep, unlearned};
use gyre_datasets::DatasetOptions;
use gyre_geometry::OwnedScan;
use gyre_masking::{
    Backend, Masker,
    model::{Card, Model},
    network::Network,
};
use gyre_radar::{PointsConfig, RasterConfig};
use gyre_simulator::{SimulatedDrive, SimulationConfig};
use ndarray::Array3;

fn cards() -> Vec<PathBuf> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../models");
    let files = fs::read_dir(folder).unwrap();
    let files = files.map(|file| file.unwrap().path());
    let is_card = |file: &PathBuf| file.extension().is_some_and(|it| it == "toml");
    files.filter(is_card).collect()
}

fn trained_raster(card: &Card) -> RasterConfig {
    RasterConfig::of(card.raster.n, card.raster.cell_m)
}

#[test]
fn every_card_fits_its_model() {
    let cards = cards();
    assert!(cards.len() >= 4, "{cards:?}");
    for path in cards {
        let config = learned(&path);
        let raster = trained_raster(&Card::read(&config).unwrap());
        let bytes = Model::read(&config, &raster).unwrap().bytes.len();
        assert!(bytes < 9_000_000, "{}: {bytes} bytes", path.display());
        // Where there are two libraries, the next test computes masks by both.
        for backend in backends().into_iter().filter(|_| !runtime_is_installed()) {
            let mut network = Network::load(&learned_by(backend, &path), &raster).unwrap();
            let bright = Array3::from_elem((network.scans(), raster.n, raster.n), 255.0);
            assert_eq!(network.run(bright.view()).unwrap().dim(), bright.dim());
        }
    }
}

#[test]
fn the_backends_agree_on_scans_of_a_simulated_drive() {
    if !runtime_is_installed() {
        return;
    }
    let scans = simulated_scans();
    for path in cards() {
        let card = Card::read(&learned(&path)).unwrap();
        let raster = trained_raster(&card);
        let rasters = rasters_of(&scans[..card.model.inputs], &raster);
        let masks = |backend| {
            let mut network = Network::load(&learned_by(backend, &path), &raster).unwrap();
            let masks = network.run(rasters.view()).unwrap().to_owned();
            assert_eq!(masks.dim(), (network.scans(), raster.n, raster.n));
            masks
        };
        let apart = (masks(Backend::Rten) - masks(Backend::OnnxRuntime)).mapv(f32::abs);
        let most = apart.iter().copied().fold(0.0, f32::max);
        let mean = apart.mean().unwrap();
        // An 8-bit network rounds the values of each layer to 256 steps. Where the libraries differ
        // in the last digit, that may be a step.
        let limits = match fs::metadata(path.with_extension("onnx")).unwrap().len() {
            ..4_000_000 => (16.0 / 255.0, 0.5 / 255.0),
            _ => (1e-5, 1e-6),
        };
        assert!(
            most <= limits.0 && mean <= limits.1,
            "{}: at most {most}, in the mean {mean}",
            path.display()
        );
    }
}

fn simulated_scans() -> [OwnedScan; 2] {
    let drive = SimulatedDrive::new(&SimulationConfig::default()).unwrap();
    let mut dataset = drive.open(&DatasetOptions::default()).unwrap();
    [0, 1].map(|number| dataset.scan(number).unwrap())
}

/// The rasters of scans, scans x n x n.
fn rasters_of(scans: &[OwnedScan], raster: &RasterConfig) -> Array3<f32> {
    let mut masker = Masker::new(raster, &PointsConfig::default(), &unlearned()).unwrap();
    let mut rasters = Array3::zeros((scans.len(), raster.n, raster.n));
    for (scan, out) in scans.iter().zip(rasters.outer_iter_mut()) {
        masker.mask(&sweep(0, scan), None, out, None).unwrap();
    }
    assert!(rasters.iter().filter(|power| **power > 0.0).count() > 1000);
    rasters
}
