//! Models and runtimes that do not fit are rejected with one sentence: the cause, the place and the
//! remedy.

mod content;

use std::{
    fs,
    path::{Path, PathBuf},
};

use crate::common::{backends, card, learned, learned_by, raster, runtime_is_installed};
use gyre_masking::networks::runtime::INSTALL;
use gyre_masking::{MaskingConfig, model::Card, network::Network};
use gyre_radar::{RasterConfig, Sampling};
use sha2::{Digest, Sha256};
use tempfile::TempDir;

fn rejected(config: &MaskingConfig, raster: &RasterConfig, words: &[&str]) {
    let sentence = Network::load(config, raster).unwrap_err().to_string();
    assert!(
        !sentence.contains('\n') && !sentence.contains("/onnxruntime_src/"),
        "{sentence}"
    );
    for word in words {
        assert!(sentence.contains(word), "`{word}` is not in: {sentence}");
    }
}

/// Copies a model into a folder of its own, with one text of its card replaced.
fn changed(name: &str, from: &str, to: &str) -> (TempDir, PathBuf) {
    let folder = tempfile::tempdir().unwrap();
    let copy = folder.path().join(card(name).file_name().unwrap());
    let text = fs::read_to_string(card(name)).unwrap();
    assert!(text.contains(from), "{text}");
    fs::write(&copy, text.replace(from, to)).unwrap();
    fs::copy(
        card(name).with_extension("onnx"),
        copy.with_extension("onnx"),
    )
    .unwrap();
    (folder, copy)
}

fn with_valid_checksum(bytes: &[u8]) -> (TempDir, PathBuf) {
    let sha256 = |bytes: &[u8]| -> String {
        Sha256::digest(bytes)
            .iter()
            .map(|byte| format!("{byte:02x}"))
            .collect()
    };
    let old = fs::read(card("single-31").with_extension("onnx")).unwrap();
    let (folder, copy) = changed("single-31", &sha256(&old), &sha256(bytes));
    fs::write(copy.with_extension("onnx"), bytes).unwrap();
    (folder, copy)
}

// Most errors of models are found without ONNX Runtime.

#[test]
fn a_card_that_is_missing_or_is_not_one_is_rejected() {
    let config = MaskingConfig {
        model: None,
        ..learned(Path::new(""))
    };
    let words = ["masking.model does not name a model", "models/NAME.toml"];
    rejected(&config, &raster(), &words);
    let words = ["card /no/such.toml", "No such file"];
    rejected(&learned(Path::new("/no/such.toml")), &raster(), &words);
    let model = card("single-31").with_extension("onnx");
    let words = ["single-31.onnx", ".toml beside it"];
    rejected(&learned(&model), &raster(), &words);
}

#[test]
fn a_card_whose_values_do_not_fit_is_rejected() {
    let not_hexadecimal = "model.sha256 is not 64 hexadecimal digits";
    let elsewhere = "must name a file in the folder of the card";
    for (from, to, words) in [
        ("sha256", "checksum", "missing field `sha256`"),
        ("inputs = 1", "inputs = 3", "model.inputs is 3"),
        ("sha256 = \"", "sha256 = \"a3f0", not_hexadecimal),
        ("sha256 = \"", "sha256 = \"\\u001b[2J", not_hexadecimal),
        ("single-31.onnx", "/etc/hostname", elsewhere),
        ("single-31.onnx", "../single-31.onnx", elsewhere),
        ("single-31.onnx", "", elsewhere),
        ("single-31.onnx", "single\\u001b[2J.onnx", elsewhere),
        ("single-31.onnx", "gone.onnx", "No such file"),
    ] {
        let (_folder, card) = changed("single-31", from, to);
        rejected(&learned(&card), &raster(), &[words]);
    }
}

#[test]
fn a_model_for_rasters_of_another_size_is_rejected() {
    let config = learned(&card("single-31"));
    let other = RasterConfig { n: 255, ..raster() };
    let (from, to) = ("raster.n is 255", "single-31.toml is for 31");
    rejected(&config, &other, &[from, to, "set raster.n = 31"]);
    let other = RasterConfig::of(31, 0.4);
    let words = ["raster.cell_m is 0.4", "set raster.cell_m = 0.8"];
    rejected(&config, &other, &words);
}

#[test]
fn a_model_with_another_checksum_is_rejected() {
    let (_folder, copy) = changed("single-31", "none: see make.py", "cut short");
    let file = copy.with_extension("onnx");
    let bytes = fs::read(&file).unwrap();
    fs::write(&file, &bytes[..bytes.len() - 1]).unwrap();
    let words = ["single-31.onnx has the SHA-256", "get it again"];
    rejected(&learned(&copy), &raster(), &words);
    let config = MaskingConfig {
        sha256: Some("0123".to_owned()),
        ..learned(&card("single-31"))
    };
    let words = ["masking.sha256 is 0123", "leave masking.sha256 out"];
    rejected(&config, &raster(), &words);
}

#[test]
fn a_model_with_other_inputs_than_its_card_states_is_rejected() {
    let (_folder, card) = changed("pair-31", "inputs = 2", "inputs = 1");
    let words = [
        "takes `scans` Float32 [1, 2, 31, 31]",
        "must have only `scans` Float32 [1, 1, 31, 31]",
    ];
    for backend in backends() {
        rejected(&learned_by(backend, &card), &raster(), &words);
    }
}

// Runtimes and execution providers.

#[test]
fn a_missing_runtime_is_reported_with_the_install_command() {
    let runtime = Some(PathBuf::from("/no/such/folder"));
    let config = MaskingConfig {
        runtime,
        ..learned(&card("single-31"))
    };
    let words = ["masking.runtime is /no/such/folder", INSTALL];
    rejected(&config, &raster(), &words);
}

#[cfg(not(any(feature = "cuda", feature = "tensorrt", feature = "openvino")))]
#[test]
fn a_provider_that_is_not_built_in_is_reported_with_its_feature() {
    use gyre_masking::Provider;

    if !runtime_is_installed() {
        return;
    }
    for (provider, name) in [
        (Provider::Cuda, "cuda"),
        (Provider::Tensorrt, "tensorrt"),
        (Provider::Openvino, "openvino"),
    ] {
        let config = MaskingConfig {
            provider,
            ..learned(&card("single-31"))
        };
        let (key, feature) = (format!("is `{name}`"), format!("--features {name},"));
        rejected(&config, &raster(), &[&key, &feature, "`cpu`"]);
    }
}

// Mismatches that are reported but not rejected.

#[test]
fn settings_that_differ_from_training_are_listed() {
    let config = learned(Path::new(""));
    let other = RasterConfig {
        sampling: Sampling::Bilinear,
        ..raster()
    };
    let mismatches = |from: &str, to: &str, raster: &RasterConfig| {
        let (_folder, path) = changed("single-31", from, to);
        let card = Card::read(&learned(&path)).unwrap();
        card.training_mismatches(&config, raster)
    };
    let none: [&str; 0] = [];
    assert_eq!(mismatches("[training]", "[training]", &other), none);
    let same = "[masking]\nfloor = 20\ncompensate = true\n[training]";
    assert_eq!(mismatches("[training]", same, &raster()), none);
    let masking = "[masking]\nfloor = 0\ncompensate = false\nundo_doppler = false\n[training]";
    assert_eq!(
        mismatches("[training]", masking, &raster()),
        [
            "masking.threshold is 20 instead of 0",
            "masking.compensate is true instead of false",
            "masking.undo_doppler is true instead of false"
        ]
    );
    let facts = "cell_m = 0.8\nsampling = \"averaged\"\nmin_range_m = 3.0";
    let nearer = "raster.min_range_m is 2 instead of 3";
    assert_eq!(mismatches("cell_m = 0.8", facts, &raster()), [nearer]);
    assert_eq!(
        mismatches("cell_m = 0.8", facts, &other),
        [nearer, "raster.sampling is bilinear instead of averaged"]
    );
}
