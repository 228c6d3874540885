//! Models and runtimes that do not fit are rejected with one sentence: the cause, the place and the
//! remedy.

mod content;

use std::{
    fs,
    path::{Path, PathBuf},
};

use crate::common::{backends, card, learned, learned_by, raster, runtime_is_installed};
use gyre_masking::networks::runtime::INSTALL;
use gyre_masking::{Backend, MaskingConfig, Provider, model::Card, network::Network};
use gyre_radar::{RasterConfig, Sampling};
use sha2::{Digest, Sha256};
use tempfile::TempDir;

/// Asserts that the network is rejected with one sentence that has all of these words.
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

/// Copies a model with other bytes and a card with their checksum.
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

// Models. Most of these errors are found without ONNX Runtime.

#[test]
fn no_model_is_named() {
    let config = MaskingConfig {
        model: None,
        ..learned(Path::new(""))
    };
    rejected(
        &config,
        &raster(),
        &["masking.model does not name a model", "models/NAME.toml"],
    );
}

#[test]
fn the_card_is_missing() {
    rejected(
        &learned(Path::new("/no/such.toml")),
        &raster(),
        &["card /no/such.toml", "No such file"],
    );
}

#[test]
fn the_model_is_named_in_place_of_its_card() {
    rejected(
        &learned(&card("single-31").with_extension("onnx")),
        &raster(),
        &["single-31.onnx", ".toml beside it"],
    );
}

#[test]
fn the_card_lacks_a_key() {
    let (_folder, card) = changed("single-31", "sha256", "checksum");
    rejected(
        &learned(&card),
        &raster(),
        &[
            "single-31.toml",
            "not the card of a model",
            "missing field `sha256`",
        ],
    );
}

#[test]
fn the_model_takes_three_scans() {
    let (_folder, card) = changed("single-31", "inputs = 1", "inputs = 3");
    rejected(&learned(&card), &raster(), &["model.inputs is 3", "1 or 2"]);
}

#[test]
fn the_checksum_is_none() {
    for more in ["a3f0", "\\u001b[2J"] {
        let (_folder, card) = changed("single-31", "sha256 = \"", &format!("sha256 = \"{more}"));
        rejected(
            &learned(&card),
            &raster(),
            &["model.sha256 is not 64 hexadecimal digits"],
        );
    }
}

#[test]
fn the_model_lies_elsewhere_or_has_a_name_that_cannot_be_printed() {
    for name in [
        "/etc/hostname",
        "../single-31.onnx",
        "",
        "single\\u001b[2J.onnx",
    ] {
        let (_folder, card) = changed("single-31", "\"single-31.onnx\"", &format!("\"{name}\""));
        rejected(
            &learned(&card),
            &raster(),
            &[
                "model.file is",
                "must name a file in the folder of the card",
            ],
        );
    }
}

#[test]
fn the_rasters_are_of_another_size() {
    let config = learned(&card("single-31"));
    let other = RasterConfig { n: 255, ..raster() };
    rejected(
        &config,
        &other,
        &[
            "raster.n is 255",
            "single-31.toml is for 31",
            "set raster.n = 31",
            "masking.model",
        ],
    );
    let other = RasterConfig {
        cell_m: 0.4,
        ..raster()
    };
    rejected(
        &config,
        &other,
        &["raster.cell_m is 0.4", "set raster.cell_m = 0.8"],
    );
}

#[test]
fn the_models_file_is_missing() {
    let (_folder, card) = changed("single-31", "single-31.onnx", "gone.onnx");
    rejected(
        &learned(&card),
        &raster(),
        &["file", "gone.onnx", "No such file"],
    );
}

#[test]
fn the_models_file_is_cut_short() {
    let (_folder, card) = changed("single-31", "none: see make.py", "cut short");
    let file = card.with_extension("onnx");
    let bytes = fs::read(&file).unwrap();
    fs::write(&file, &bytes[..bytes.len() - 1]).unwrap();
    rejected(
        &learned(&card),
        &raster(),
        &[
            "single-31.onnx has the SHA-256",
            "its card says",
            "get it again",
        ],
    );
}

#[test]
fn the_model_is_not_that_of_the_configured_checksum() {
    let config = MaskingConfig {
        sha256: Some("0123".to_owned()),
        ..learned(&card("single-31"))
    };
    rejected(
        &config,
        &raster(),
        &[
            "masking.sha256 is 0123",
            "single-31.toml",
            "leave masking.sha256 out",
        ],
    );
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
    rejected(
        &config,
        &raster(),
        &["masking.runtime is /no/such/folder", INSTALL],
    );
}

#[test]
fn settings_of_onnx_runtime_are_rejected_for_rten() {
    let rten = || learned_by(Backend::Rten, &card("single-31"));
    let runtime = MaskingConfig {
        runtime: Some(PathBuf::from("/anywhere")),
        ..rten()
    };
    let provider = MaskingConfig {
        provider: Provider::Cuda,
        ..rten()
    };
    for (config, key) in [(runtime, "runtime"), (provider, "provider")] {
        let sentence = config.validate().unwrap_err().to_string();
        let words = format!("{key} is a setting of ONNX Runtime");
        assert!(sentence.contains(&words), "{sentence}");
    }
}

#[test]
fn tract_is_rejected_with_what_replaces_it() {
    let read = |text| toml::from_str::<MaskingConfig>(text);
    let sentence = read("backend = \"tract\"").unwrap_err().to_string();
    for words in ["no longer part of Gyre", "set masking.backend to `rten`"] {
        assert!(sentence.contains(words), "{sentence}");
    }
    let sentence = read("backend = \"onyx\"").unwrap_err().to_string();
    assert!(sentence.contains("expected one of `auto`"), "{sentence}");
    assert_eq!(read("backend = \"rten\"").unwrap().backend, Backend::Rten);
    assert_eq!(read("").unwrap().backend, Backend::Auto);
}

#[cfg(not(any(feature = "cuda", feature = "tensorrt", feature = "openvino")))]
#[test]
fn a_provider_that_is_not_built_in_is_reported_with_its_feature() {
    if !runtime_is_installed() {
        return;
    }
    for (provider, feature) in [
        (Provider::Cuda, "cuda"),
        (Provider::Tensorrt, "tensorrt"),
        (Provider::Openvino, "openvino"),
    ] {
        let config = MaskingConfig {
            provider,
            ..learned(&card("single-31"))
        };
        rejected(
            &config,
            &raster(),
            &[feature, &format!("--features {feature}"), "`cpu`"],
        );
    }
}

// Mismatches that are reported but not rejected.

#[test]
fn settings_that_differ_from_training_are_listed() {
    let card = |training: &str| {
        let (_folder, path) = changed(
            "single-31",
            "[training]",
            &format!("[masking]\n{training}\n[training]"),
        );
        Card::read(&learned(&path)).unwrap()
    };
    let config = learned(Path::new(""));
    let other = RasterConfig {
        sampling: Sampling::Bilinear,
        ..raster()
    };
    assert!(card("").training_mismatches(&config, &other).is_empty());
    assert!(
        card("floor = 20\ncompensate = true")
            .training_mismatches(&config, &raster())
            .is_empty()
    );
    assert_eq!(
        card("floor = 0\ncompensate = false").training_mismatches(&config, &raster()),
        [
            "masking.threshold is 20 instead of 0",
            "masking.compensate is true instead of false"
        ]
    );
    assert_eq!(
        card("undo_doppler = false").training_mismatches(&config, &raster()),
        ["masking.undo_doppler is true instead of false"]
    );
    let facts = "cell_m = 0.8\nsampling = \"averaged\"\naveraged_cells = 2.0\nmin_range_m = 3.0";
    let (_folder, path) = changed("single-31", "cell_m = 0.8", facts);
    let card = Card::read(&learned(&path)).unwrap();
    let nearer = "raster.min_range_m is 2 instead of 3";
    assert_eq!(
        card.training_mismatches(&config, &raster()),
        [nearer, "raster.averaged_cells is 1 instead of 2"]
    );
    assert_eq!(
        card.training_mismatches(&config, &other),
        [nearer, "raster.sampling is bilinear instead of averaged"]
    );
}
