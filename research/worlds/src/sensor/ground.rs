//! Backscatter of the ground: road, verges, lawns and fields, in patches of varying slope.

use nalgebra::Point2;

use super::elevation::spot_gain;
use super::sweep_poses::AzimuthPose;
use crate::place_noise::smooth_noise;
use crate::profile::Receiver;
use crate::relief::Relief;

/// Backscatter of a square metre of ground at a grazing angle, median, dB: dry asphalt at 77 GHz;
/// rough grass is 20 dB above it.
const REFLECTIVITY_DB: f64 = -50.0;
/// Variation between patches, standard deviation, dB, and their size, metres.
const PATCHES_DB: f64 = 11.0;
const PATCH_M: f64 = 14.0;

/// Height of the antenna above level ground, metres.
const ANTENNA_M: f64 = 2.0;
/// Limit of the factor by which ground that rises into the beam is brighter than level ground:
/// grass at a steeper angle, 20 dB above asphalt.
const MAX_RISEN: f64 = 100.0;

/// Power from the ground in one resolution cell on the axis of a beam, without occlusion.
pub(super) fn ground_power(
    from: &AzimuthPose,
    range_m: f64,
    relief: Relief,
    receiver: &Receiver,
) -> f64 {
    let place = from.position + from.beam * range_m;
    let area_m2 = range_m * receiver.beam_rad * receiver.cell_m;
    let reflectivity =
        10f64.powf((REFLECTIVITY_DB + PATCHES_DB * smooth_noise(place, PATCH_M, 0)) / 10.0);
    let power = reflectivity * area_m2 * receiver.sensitivity(range_m);
    if relief.is_level() {
        power
    } else {
        power * risen_factor(from, place, relief, receiver.beam_height_rad)
    }
}

/// Factor on the power of the ground at a place on hills: 1 as on level ground, more where it rises
/// into the beam, and nothing where it falls away.
fn risen_factor(
    from: &AzimuthPose,
    place: Point2<f64>,
    relief: Relief,
    beam_height_rad: f64,
) -> f64 {
    let range_m = (place - from.position).norm();
    let gain = |height_m: f64, elevation_rad: f64| {
        spot_gain(height_m / range_m - elevation_rad, beam_height_rad)
    };
    let level = gain(-ANTENNA_M, 0.0).max(1.0 / MAX_RISEN);
    let rise_m = relief.rise_m(from.position, place);
    (gain(rise_m - ANTENNA_M, from.elevation_rad) / level).min(MAX_RISEN)
}
