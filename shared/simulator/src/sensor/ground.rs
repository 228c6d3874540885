//! Backscatter of the ground: road, verges, lawns and fields, in patches of varying slope.

use nalgebra::Point2;

use super::place_noise::smooth_noise;
use crate::profile::Receiver;

/// Backscatter of a square metre of ground at a grazing angle, median, dB: dry asphalt at 77 GHz;
/// rough grass is 20 dB above it.
const REFLECTIVITY_DB: f64 = -50.0;
/// Variation between patches, standard deviation, dB, and their size, metres.
const PATCHES_DB: f64 = 11.0;
const PATCH_M: f64 = 14.0;

/// Power from the ground in one resolution cell, without occlusion.
pub(super) fn ground_power(place: Point2<f64>, range_m: f64, receiver: &Receiver) -> f64 {
    let area_m2 = range_m * receiver.beam_rad * receiver.cell_m;
    let reflectivity =
        10f64.powf((REFLECTIVITY_DB + PATCHES_DB * smooth_noise(place, PATCH_M, 0)) / 10.0);
    reflectivity * area_m2 * receiver.sensitivity(range_m)
}
