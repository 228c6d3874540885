//! The content of a model's file.

use std::fs;

use gyre_masking::{Backend, network::Network};
use ndarray::Array3;
use rten_onnx::onnx::{DataLocation, ModelProto, StringStringEntryProto};

use super::{rejected, with_valid_checksum};
use crate::common::{N, backends, card, learned_by, raster};

#[test]
fn a_model_that_the_backend_cannot_read_is_rejected() {
    let bytes = fs::read(card("single-31").with_extension("onnx")).unwrap();
    let (_folder, cut_short) = with_valid_checksum(&bytes[..bytes.len() / 2]);
    let (_folder, other) = with_valid_checksum(b"no model");
    for backend in backends() {
        let cannot = format!("{} cannot load", backend.name());
        for card in [&cut_short, &other] {
            let config = learned_by(backend, card);
            rejected(&config, &raster(), &[&cannot, "single-31.onnx"]);
        }
    }
}

/// Both runtimes would compute with whatever the other file has, and one of them takes it from the
/// current folder.
#[test]
fn weights_in_another_file_are_rejected_with_the_remedy() {
    let bytes = fs::read(card("single-31").with_extension("onnx")).unwrap();
    let mut model = ModelProto::parse_buf(&bytes).unwrap();
    let weights = &mut model.graph.as_mut().unwrap().initializer[0];
    weights.raw_data = None;
    weights.float_data.clear();
    weights.data_location = Some(DataLocation::EXTERNAL);
    weights.external_data = vec![StringStringEntryProto {
        key: Some("location".to_owned()),
        value: Some("single-31.onnx.data".to_owned()),
    }];
    let (folder, card) = with_valid_checksum(&model.write_buf().unwrap());
    let beside = folder.path().join("single-31.onnx.data");
    fs::write(beside, [0; 36]).unwrap();
    for backend in backends() {
        let words = [
            "single-31.onnx keeps weights in another file, which the SHA-256",
            "`onnx.save(onnx.load(NAME), NAME)`",
            "its new SHA-256 into the card",
        ];
        rejected(&learned_by(backend, &card), &raster(), &words);
    }
}

#[test]
fn operators_that_are_unknown_or_do_not_fit_each_other_are_rejected() {
    let bytes = fs::read(card("single-31").with_extension("onnx")).unwrap();
    // Without its padding, a convolution gives smaller masks.
    let (padding, none) = (b"@\x01@\x01@\x01@\x01", b"@\x00@\x00@\x00@\x00");
    for (from, to, word) in [
        (&b"Sigmoid"[..], &b"Sigmold"[..], "Sigmold"),
        (padding, none, "841 values instead of 961"),
    ] {
        let mut edited = bytes.clone();
        let mut places = edited.windows(from.len());
        let place = places.position(|window| window == from).unwrap();
        edited[place..][..to.len()].copy_from_slice(to);
        let (_folder, card) = with_valid_checksum(&edited);
        let words = ["rten cannot load", "single-31.onnx", word];
        rejected(&learned_by(Backend::Rten, &card), &raster(), &words);
    }
}

#[test]
fn a_damaged_model_is_rejected_with_one_sentence_or_computed() {
    let bytes = fs::read(card("single-31").with_extension("onnx")).unwrap();
    let cut = (0..bytes.len()).step_by(3);
    let cut = cut.map(|length| bytes[..length].to_vec());
    let edited = (0..bytes.len()).map(|place| {
        let mut edited = bytes.clone();
        edited[place] ^= [0x01, 0x80][place % 2];
        edited
    });
    let mut loaded = 0;
    for damaged in cut.chain(edited) {
        let (_folder, card) = with_valid_checksum(&damaged);
        match Network::load(&learned_by(Backend::Rten, &card), &raster()) {
            Ok(_) => loaded += 1,
            Err(error) => assert!(!error.to_string().contains('\n'), "{error}"),
        }
    }
    // Changed weights are weights.
    assert!((10..150).contains(&loaded), "{loaded}");
}

#[test]
fn operators_that_are_too_new_are_rejected() {
    for backend in backends() {
        let newest = match backend {
            Backend::Rten => ["this rten knows them up to 26", "opset=26"],
            _ => ["this ONNX Runtime knows them up to 2", "opset=2"],
        };
        let version = "opset-99.onnx has operators of version 99";
        rejected(
            &learned_by(backend, &card("opset-99")),
            &raster(),
            &[&[version][..], &newest[..]].concat(),
        );
    }
}

#[test]
fn factors_that_are_nan_are_rejected() {
    for backend in backends() {
        let config = learned_by(backend, &card("single-31"));
        let mut network = Network::load(&config, &raster()).unwrap();
        let mut cells = Array3::from_elem((1, N, N), 1.0);
        assert!(network.run(cells.view()).is_ok());
        cells[[0, N / 2, N / 2]] = f32::NAN;
        let sentence = network.run(cells.view()).unwrap_err().to_string();
        assert!(
            sentence.contains("9 of 961 factors are NaN") && sentence.contains("`cpu`"),
            "{sentence}"
        );
    }
}
