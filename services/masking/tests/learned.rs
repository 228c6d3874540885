//! Learned masks, beside the same arithmetic by hand.

#![allow(clippy::unwrap_used)]

mod common;

use common::{
    CELLS, N, assert_masked, card, learned, masker, masks_by_hand, raster, runtime_is_installed,
    scan, sweep, unlearned, unmasked,
};
use gyre_masking::{MaskingConfig, Sweep, network::Network};
use gyre_messages::MaskedHeader;

/// Room for two rasters, and where the second one begins.
fn room() -> (Vec<f32>, usize) {
    let second = MaskedHeader::raster_values(CELLS);
    (vec![f32::NAN; 2 * second], second)
}

#[test]
fn a_raster_is_multiplied_by_the_networks_mask_of_it() {
    if !runtime_is_installed() {
        return;
    }
    let mut masker = masker(&learned(&card("single-31")));
    assert_eq!(masker.rasters(), 1);
    for seed in 0..3 {
        let scan = scan(seed);
        let sweep = sweep(seed as u64, &scan);
        let mut out = vec![0.0; CELLS];
        assert!(masker.mask(&sweep, None, &mut out).unwrap().is_some());
        let raster = unmasked(&sweep);
        assert_masked(
            &out,
            &raster,
            &masks_by_hand(std::slice::from_ref(&raster))[0],
        );
    }
}

#[test]
fn a_network_that_looks_at_two_scans_masks_both_for_this_pair() {
    if !runtime_is_installed() {
        return;
    }
    let mut masker = masker(&learned(&card("pair-31")));
    assert_eq!(masker.rasters(), 2);
    let scans = [0, 1, 2].map(scan);
    for later in 1..3 {
        let [before, now] = [later - 1, later].map(|number| sweep(number as u64, &scans[number]));
        let (mut out, second) = room();
        masker.mask(&now, Some(&before), &mut out).unwrap();
        let rasters = [unmasked(&now), unmasked(&before)];
        let masks = masks_by_hand(&rasters);
        assert_masked(&out[..CELLS], &rasters[0], &masks[0]);
        assert_masked(&out[second..][..CELLS], &rasters[1], &masks[1]);
    }
}

#[test]
fn where_the_chain_starts_a_scan_is_its_own_scan_before() {
    if !runtime_is_installed() {
        return;
    }
    let (scan, mut masker) = (scan(0), masker(&learned(&card("pair-31"))));
    let (mut alone, _) = room();
    masker.mask(&sweep(0, &scan), None, &mut alone).unwrap();
    let raster = unmasked(&sweep(0, &scan));
    assert_masked(
        &alone[..CELLS],
        &raster,
        &masks_by_hand(&[raster.clone(), raster.clone()])[0],
    );
}

#[test]
fn a_masker_that_was_started_anew_makes_the_same_bits() {
    if !runtime_is_installed() {
        return;
    }
    let config = learned(&card("pair-31"));
    let scans = [0, 1, 2].map(scan);
    let [first, second, third] = [0, 1, 2].map(|number| sweep(number as u64, &scans[number]));
    let ((mut undisturbed, _), (mut restarted, _)) = (room(), room());
    let mut old = masker(&config);
    old.mask(&first, None, &mut undisturbed).unwrap();
    old.mask(&second, Some(&first), &mut undisturbed).unwrap();
    old.mask(&third, Some(&second), &mut undisturbed).unwrap();
    masker(&config)
        .mask(&third, Some(&second), &mut restarted)
        .unwrap();
    assert_eq!(bits(&undisturbed), bits(&restarted));
}

/// Bits, so that padding that is not a number equals itself.
fn bits(values: &[f32]) -> Vec<u32> {
    values.iter().map(|value| value.to_bits()).collect()
}

#[test]
fn the_same_scans_give_the_same_bits_with_any_number_of_threads() {
    if !runtime_is_installed() {
        return;
    }
    let run = |threads| {
        let config = MaskingConfig {
            threads,
            ..learned(&card("single-31"))
        };
        let mut network = Network::load(&config, &raster()).unwrap();
        let raster = unmasked(&sweep(0, &scan(0)));
        let masks: Vec<_> = (0..3)
            .map(|_| bits(network.run(&raster).unwrap()))
            .collect();
        assert!(masks.windows(2).all(|pair| pair[0] == pair[1]));
        masks.into_iter().next()
    };
    assert_eq!(run(1), run(1));
    assert_eq!(run(1), run(2));
}

#[test]
fn points_are_weighed_by_the_masks_of_their_cells() {
    if !runtime_is_installed() {
        return;
    }
    let scan = scan(1);
    let sweep = Sweep {
        motion: None,
        ..sweep(1, &scan)
    };
    let points = |config: &MaskingConfig| {
        let (mut masker, (mut out, _)) = (masker(config), room());
        let twist = masker.mask(&sweep, None, &mut out).unwrap();
        let mut points = vec![gyre_geometry::SparsePoint::default(); 8192];
        let count = masker.points(&sweep.scan, twist, &mut points).unwrap();
        points.truncate(count);
        points
    };
    for (model, scans) in [("single-31", 1), ("pair-31", 2)] {
        let weighed = points(&learned(&card(model)));
        let plain = points(&MaskingConfig {
            point_exponent: 0.0,
            ..learned(&card(model))
        });
        assert_eq!(plain, points(&unlearned()));
        assert_eq!(weighed.len(), plain.len());
        let mask = &masks_by_hand(&vec![unmasked(&sweep); scans])[0];
        let index = |metres: f32| (N as f32 / 2.0 - metres / 0.8).floor();
        let mut inside = 0;
        for (weighed, plain) in weighed.iter().zip(&plain) {
            let (row, column) = (index(plain.x_m), index(plain.y_m));
            let is_inside = row.min(column) >= 0.0 && row.max(column) < N as f32;
            let factor = if is_inside {
                mask[row as usize * N + column as usize].sqrt()
            } else {
                1.0
            };
            assert!(
                (weighed.weight - factor * plain.weight).abs() < 1e-5,
                "{weighed:?}, {plain:?}"
            );
            inside += usize::from(is_inside);
        }
        assert!(
            inside > 100 && inside < plain.len(),
            "{inside} of {}",
            plain.len()
        );
    }
}
