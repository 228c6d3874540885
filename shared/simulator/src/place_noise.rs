//! Pseudo-random numbers that depend on the place alone, so that they are the same in every scan.

use nalgebra::Point2;

/// A number from 0 to 1 for a place; each `index` gives a different number.
pub(crate) fn place_hash(place: Point2<f64>, index: u64) -> f64 {
    // The finaliser of SplitMix64 (Steele et al. 2014) over both coordinates' bits.
    let mut bits = place.x.to_bits()
        ^ place.y.to_bits().rotate_left(32)
        ^ index.wrapping_mul(0x9e37_79b9_7f4a_7c15);
    bits = (bits ^ (bits >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    bits = (bits ^ (bits >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    ((bits ^ (bits >> 31)) >> 11) as f64 / (1u64 << 53) as f64
}
