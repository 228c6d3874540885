//! Shared by the tests of learned masks: models, a scan, and a reference computation of the models.

// Each test binary uses a part of this.
#![allow(dead_code, clippy::unwrap_used)]

mod sweep;

use std::path::{Path, PathBuf};

use gyre_geometry::OwnedScan;
use gyre_masking::{Backend, MaskKind, Masker, MaskingConfig, Sweep, networks::runtime};
use gyre_radar::{PointsConfig, RasterConfig};
use ndarray::Array2;

/// Cells per side of the models with a reference computation.
pub const N: usize = 31;

const AZIMUTHS: usize = 400;
const BINS: usize = 200;

/// The card of a test model: see `models/make.py`.
pub fn card(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("tests/models")
        .join(name)
        .with_extension("toml")
}

/// Returns whether ONNX Runtime is installed, and prints a note if not.
pub fn runtime_is_installed() -> bool {
    let found = runtime::find(None).is_ok();
    if !found {
        println!("skipped: ONNX Runtime is not installed");
    }
    found
}

/// The backends that can be tested here: rten, and ONNX Runtime where it is installed.
pub fn backends() -> Vec<Backend> {
    match runtime_is_installed() {
        true => vec![Backend::Rten, Backend::OnnxRuntime],
        false => vec![Backend::Rten],
    }
}

/// The rasters of the models with `-31` in their names.
pub fn raster() -> RasterConfig {
    RasterConfig::of(N, 0.8)
}

/// A learned mask of this model, above a threshold of 20.
pub fn learned(card: &Path) -> MaskingConfig {
    MaskingConfig {
        kind: MaskKind::Learned,
        threshold: 20,
        model: Some(card.to_owned()),
        undo_doppler: true,
        ..MaskingConfig::default()
    }
}

pub fn learned_by(backend: Backend, card: &Path) -> MaskingConfig {
    MaskingConfig {
        backend,
        ..learned(card)
    }
}

/// The same without the network.
pub fn unlearned() -> MaskingConfig {
    MaskingConfig {
        kind: MaskKind::Threshold,
        model: None,
        ..learned(Path::new(""))
    }
}

pub fn masker(config: &MaskingConfig) -> Masker {
    Masker::new(&raster(), &PointsConfig::default(), config).unwrap()
}

pub fn scan(seed: usize) -> OwnedScan {
    let mut scan = sweep::of(AZIMUTHS, BINS, 0.175);
    for (place, byte) in scan.bytes.iter_mut().enumerate() {
        let (azimuth, bin) = (place / BINS, place % BINS);
        *byte = ((azimuth / 9 * 31 + bin / 5 * 57 + seed * 101) % 251) as u8;
    }
    scan
}

/// The scan with the velocity of a bend at 12 m/s.
pub fn sweep(number: u64, scan: &OwnedScan) -> Sweep<'_> {
    Sweep {
        number,
        scan: scan.view(),
        twist: Some([12.0, 0.1, 0.2].into()),
    }
}

/// An empty raster.
pub fn blank() -> Array2<f32> {
    Array2::from_elem((N, N), f32::NAN)
}

pub fn unmasked(sweep: &Sweep<'_>) -> Array2<f32> {
    let mut raster = blank();
    masker(&unlearned())
        .mask(sweep, None, raster.view_mut(), None)
        .unwrap();
    raster
}

/// Computes the masks of the test models, one for each raster: the sigmoid of a convolution, as in
/// `models/make.py`.
pub fn reference_masks(rasters: &[Array2<f32>]) -> Vec<Array2<f32>> {
    let channels = rasters.len();
    let kernel = |place: usize| ((place * 5 % 13) as f64 - 6.0) / 64.0;
    let power = |channel: usize, row: isize, column: isize| {
        let inside = |index: isize| (0..N as isize).contains(&index);
        if inside(row) && inside(column) {
            f64::from(rasters[channel][[row as usize, column as usize]]) / 16.0
        } else {
            0.0
        }
    };
    let logit = |out: usize, row: usize, column: usize| {
        let taps = (0..channels * 9).map(|tap| {
            let (of, dy, dx) = (tap / 9, (tap % 9 / 3) as isize - 1, (tap % 3) as isize - 1);
            kernel(out * channels * 9 + tap) * power(of, row as isize + dy, column as isize + dx)
        });
        out as f64 / 4.0 + 0.125 + taps.sum::<f64>()
    };
    let mask = |out: usize| {
        Array2::from_shape_fn((N, N), |(row, column)| {
            (1.0 / (1.0 + (-logit(out, row, column)).exp())) as f32
        })
    };
    (0..channels).map(mask).collect()
}

pub fn assert_masked(actual: &Array2<f32>, raster: &Array2<f32>, mask: &Array2<f32>) {
    assert!(
        raster.iter().filter(|power| **power > 0.0).count() > N * N / 2,
        "a nearly empty raster tests nothing"
    );
    for ((cell, actual), (power, mask)) in actual.indexed_iter().zip(raster.iter().zip(mask)) {
        let expected = power * mask;
        assert!(
            (actual - expected).abs() <= 1e-5 * power,
            "cell {cell:?}: {actual}, not {expected}"
        );
    }
}
