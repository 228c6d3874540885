//! Descriptors of one place from other headings and positions, and the search for them.

use std::f64::consts::FRAC_PI_2;

use gyre_geometry::{pose, wrap_angle};
use gyre_matching::Submap;
use gyre_slam::estimation::places::{Descriptor, OrderError, PlaceIndex};
use proptest::prelude::*;

use super::scenes::{self, describe, described};

fn index_of(descriptors: &[Descriptor]) -> PlaceIndex {
    let mut index = PlaceIndex::default();
    for (k, descriptor) in descriptors.iter().enumerate() {
        index.insert(k as u64, 20.0 * k as f64, descriptor).unwrap();
    }
    index
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(24))]
    #[test]
    fn a_place_is_found_at_any_heading_and_its_angle_up_to_half_a_turn(
        seed in 0_u64..1000, x in -2.0_f64..2.0, y in -2.0_f64..2.0, yaw in -3.1_f64..3.1,
    ) {
        let place = scenes::place(seed);
        let later = describe(&scenes::seen(&place, &pose(x, y, yaw)));
        let mut index = index_of(&[described(seed + 1), described(seed)]);
        let found = index.query(&later, 2, 0.0);
        prop_assert!(found[0].place == 1 && found[0].score > found[1].score + 0.1, "{found:?}");
        prop_assert!(found[0].yaw_rad.abs() <= FRAC_PI_2);
        // Doubled, angles half a turn apart are the same.
        let off = 0.5 * wrap_angle(2.0 * (found[0].yaw_rad - yaw));
        prop_assert!(off.abs() < 0.02, "{off}");
    }
}

#[test]
fn a_rotation_hardly_changes_the_sieve() {
    let place = scenes::place(1);
    let sieve = |place: &[[f64; 2]], yaw| {
        let mut bytes = Vec::new();
        describe(&scenes::seen(place, &pose(0.0, 0.0, yaw))).encode(&mut bytes);
        bytes[..Descriptor::SIEVE_BYTES].to_vec()
    };
    let apart = |a: &[u8], b: &[u8]| -> u32 {
        let pairs = a.iter().zip(b);
        pairs.map(|(a, b)| u32::from(a.abs_diff(*b))).sum()
    };
    let (straight, turned) = (sieve(&place, 0.0), sieve(&place, 1.2));
    let other = sieve(&scenes::place(2), 0.0);
    assert!(3 * apart(&straight, &turned) < apart(&straight, &other));
}

#[test]
fn an_empty_submap_is_similar_to_nothing() {
    let (empty, full) = (describe(&Submap::default()), described(1));
    assert_eq!(empty, Descriptor::default());
    let mut index = index_of(&[empty.clone(), full.clone()]);
    let mut found = index.query(&empty, 2, 0.0).iter();
    assert!(found.all(|found| found.score == 0.0));
    assert_eq!(index.query(&full, 1, 0.0)[0].score, 0.0);
}

#[test]
fn only_eligible_places_are_found_and_those_near_a_better_one_are_left_out() {
    let descriptors: Vec<Descriptor> = (0..50).map(described).collect();
    let mut index = index_of(&descriptors);
    let best = index.query(&descriptors[40], 50, 0.0)[0];
    assert_eq!(best.place, 40);
    assert!((best.score - 1.0).abs() < 1e-4 && best.yaw_rad.abs() < 1e-3);
    let by_angles = index.rank_all(&descriptors[40], 3);
    assert!(by_angles[0] == best && by_angles.len() > 50);
    assert!(by_angles.is_sorted_by(|a, b| a.score >= b.score));
    assert_eq!(index.query(&descriptors[40], 50, 0.0).len(), 32);
    let mut earlier = index.query(&descriptors[40], 40, 0.0).iter();
    assert!(earlier.all(|found| found.place < 40));
    assert_eq!(index.query(&descriptors[40], 0, 0.0), []);
    let found = index.query(&descriptors[40], 50, 50.0).to_vec();
    assert_eq!(found[0].place, 40);
    for (k, one) in found.iter().enumerate() {
        let mut better = found[..k].iter();
        assert!(better.all(|other| other.place.abs_diff(one.place) >= 3));
    }
    assert_eq!(index.places_until(60.0), 4);
}

#[test]
fn places_are_added_in_the_order_of_the_path() {
    let mut index = PlaceIndex::default();
    let descriptor = Descriptor::default();
    index.insert(7, 10.0, &descriptor).unwrap();
    let error = OrderError {
        path_m: 9.0,
        last_m: 10.0,
    };
    assert_eq!(index.insert(8, 9.0, &descriptor), Err(error));
    assert!(index.insert(8, f64::NAN, &descriptor).is_err());
    assert_eq!(
        (index.len(), index.insert(8, 10.0, &descriptor)),
        (1, Ok(1))
    );
}
