//! The network of moving objects in both libraries. A process opens only one ONNX Runtime, so the
//! tests of the search for it are in a separate process.
#![allow(clippy::unwrap_used)]

use gyre_masking::networks::{PlanesNetwork, runtime};

const NAME: &str = "gyre:models/objects.onnx";
const SHAPES: [[usize; 3]; 2] = [[8, 256, 256], [44, 64, 64]];

#[test]
fn both_libraries_compute_the_same() {
    let mut by_rten = PlanesNetwork::load(NAME, None, SHAPES).unwrap();
    let mut planes = vec![0.0; 8 * 256 * 256];
    (0..planes.len())
        .step_by(97)
        .for_each(|cell| planes[cell] = 0.6);
    let one = by_rten.compute(&planes).unwrap();
    assert_eq!(one.len(), 44 * 64 * 64);
    let Ok(runtime) = runtime::find(None) else {
        return println!("skipped: ONNX Runtime is not installed");
    };
    let mut by_runtime = PlanesNetwork::load(NAME, Some(&runtime), SHAPES).unwrap();
    let other = by_runtime.compute(&planes).unwrap();
    let apart = one.iter().zip(&other).map(|(a, b)| (a - b).abs());
    assert!(apart.fold(0.0, f32::max) < 1e-3);
}

#[test]
fn planes_that_do_not_fit_and_a_network_that_is_not_there_are_said() {
    let shapes = [SHAPES[0], [44, 128, 128]];
    let mut network = PlanesNetwork::load(NAME, None, shapes).unwrap();
    let wrong = network.compute(&vec![0.0; 8 * 256 * 256]).unwrap_err();
    let said = "gyre:models/objects.onnx cannot be computed: it gives [1, 44, 64, 64]";
    assert_eq!(wrong.to_string(), said);
    assert!(network.compute(&[0.0; 5]).is_err());
    assert!(PlanesNetwork::load("gyre:models/none.onnx", None, SHAPES).is_err());
}
