//! Learned masks against a reference computation of the same networks.

use crate::common::{
    N, assert_masked, backends, blank, card, learned_by, masker, raster, reference_masks, scan,
    sweep, unlearned, unmasked,
};
use gyre_geometry::SparsePoint;
use gyre_masking::{MaskError, Masker, MaskingConfig, Sweep, network::Network};
use ndarray::{Array2, Axis};

fn masked_pair(masker: &mut Masker, sweep: &Sweep<'_>, follows: Option<u64>) -> [Array2<f32>; 2] {
    let (mut later, mut earlier) = (blank(), blank());
    masker
        .mask(sweep, follows, later.view_mut(), Some(earlier.view_mut()))
        .unwrap();
    [later, earlier]
}

#[test]
fn a_raster_is_multiplied_by_the_networks_mask_of_it() {
    for backend in backends() {
        let mut masker = masker(&learned_by(backend, &card("single-31")));
        assert_eq!(masker.scans(), 1);
        for seed in 0..3 {
            let scan = scan(seed);
            let sweep = sweep(seed as u64, &scan);
            let mut out = blank();
            let twist = masker.mask(&sweep, None, out.view_mut(), None).unwrap();
            assert_eq!(twist, sweep.twist);
            let raster = unmasked(&sweep);
            let masks = reference_masks(std::slice::from_ref(&raster));
            assert_masked(&out, &raster, &masks[0]);
        }
    }
}

#[test]
fn a_network_of_two_scans_masks_both_for_this_pair() {
    for backend in backends() {
        let mut masker = masker(&learned_by(backend, &card("pair-31")));
        assert_eq!(masker.scans(), 2);
        let scans = [0, 1, 2].map(scan);
        masker.set_previous(&sweep(0, &scans[0])).unwrap();
        for later in 1..3 {
            let [previous, current] =
                [later - 1, later].map(|number| sweep(number as u64, &scans[number]));
            let masked = masked_pair(&mut masker, &current, Some(previous.number));
            let rasters = [unmasked(&current), unmasked(&previous)];
            let masks = reference_masks(&rasters);
            for (masked, (raster, mask)) in masked.iter().zip(rasters.iter().zip(&masks)) {
                assert_masked(masked, raster, mask);
            }
        }
    }
}

#[test]
fn a_restarted_masker_makes_the_same_bits() {
    for backend in backends() {
        let config = learned_by(backend, &card("pair-31"));
        let scans = [0, 1, 2].map(scan);
        let [first, second, third] = [0, 1, 2].map(|number| sweep(number as u64, &scans[number]));
        let (mut old, mut new) = (masker(&config), masker(&config));
        masked_pair(&mut old, &first, None);
        masked_pair(&mut old, &second, Some(0));
        let undisturbed = masked_pair(&mut old, &third, Some(1));
        assert!(old.can_follow(2) && !new.can_follow(1));
        new.set_previous(&second).unwrap();
        assert_eq!(undisturbed, masked_pair(&mut new, &third, Some(1)));
    }
}

#[test]
fn the_first_scan_of_a_chain_is_its_own_previous_scan_and_no_other_lacks_one() {
    for backend in backends() {
        let (scan, mut masker) = (scan(0), masker(&learned_by(backend, &card("pair-31"))));
        let (mut later, mut earlier) = (blank(), blank());
        let views = (later.view_mut(), Some(earlier.view_mut()));
        let masked = masker.mask(&sweep(8, &scan), Some(7), views.0, views.1);
        assert!(matches!(masked, Err(MaskError::MissingPrevious(7))));
        let [alone, _] = masked_pair(&mut masker, &sweep(0, &scan), None);
        let raster = unmasked(&sweep(0, &scan));
        let masks = reference_masks(&[raster.clone(), raster.clone()]);
        assert_masked(&alone, &raster, &masks[0]);
    }
}

#[test]
fn the_same_scans_give_the_same_bits_with_any_number_of_threads() {
    for backend in backends() {
        let run = |threads| {
            let config = MaskingConfig {
                threads,
                ..learned_by(backend, &card("single-31"))
            };
            let mut network = Network::load(&config, &raster()).unwrap();
            let raster = unmasked(&sweep(0, &scan(0))).insert_axis(Axis(0));
            let masks = [(); 3].map(|()| network.run(raster.view()).unwrap().to_owned());
            assert!(masks.windows(2).all(|pair| pair[0] == pair[1]));
            masks
        };
        assert_eq!(run(1), run(1));
        assert_eq!(run(1), run(2));
    }
}

#[test]
fn points_are_weighted_by_the_masks_of_their_cells() {
    for backend in backends() {
        let scan = scan(1);
        let sweep = Sweep {
            twist: None,
            ..sweep(1, &scan)
        };
        let points = |config: &MaskingConfig| {
            let mut masker = masker(config);
            masked_pair(&mut masker, &sweep, None);
            let mut points = vec![SparsePoint::default(); 8192];
            let count = masker.points(&sweep.scan, None, &mut points).unwrap();
            points.truncate(count);
            points
        };
        for (model, scans) in [("single-31", 1), ("pair-31", 2)] {
            let weighted = points(&learned_by(backend, &card(model)));
            let plain = points(&MaskingConfig {
                point_exponent: 0.0,
                ..learned_by(backend, &card(model))
            });
            assert_eq!(plain, points(&unlearned()));
            assert_eq!(weighted.len(), plain.len());
            let mask = &reference_masks(&vec![unmasked(&sweep); scans])[0];
            let index = |metres: f32| (N as f32 / 2.0 - metres / 0.8).floor();
            let mut inside = 0;
            for (weighted, plain) in weighted.iter().zip(&plain) {
                let (row, column) = (index(plain.x_m), index(plain.y_m));
                let is_inside = row.min(column) >= 0.0 && row.max(column) < N as f32;
                let factor = match is_inside {
                    true => mask[[row as usize, column as usize]].sqrt(),
                    false => 1.0,
                };
                let off = weighted.weight - factor * plain.weight;
                assert!(off.abs() < 1e-5, "{weighted:?}, {plain:?}");
                inside += usize::from(is_inside);
            }
            assert!(inside > 100 && inside < plain.len(), "{inside}");
        }
    }
}
