//! The difference of all results from those of Gyre's own stage, in a sentence.

use gyre_harness::{
    Recorded,
    result::{Difference, difference, result_bytes},
};
use gyre_messages::{Masked, Message, Rotation, Scan, flag};
use gyre_stage::StageError;

/// Returns how far results are from those of Gyre's own stage. Items that only one of them has are
/// left out.
///
/// # Errors
/// Messages of another topic.
pub(crate) fn deviation(
    topic: &str,
    own: &[Recorded],
    other: &[Recorded],
) -> Result<String, StageError> {
    let (mut items, mut equal, mut differences) = (0, 0, Vec::new());
    for own in own.iter().filter(|own| !own.item().is(flag::END)) {
        let seq = own.item().seq;
        let is_same = |it: &&Recorded| it.item().seq == seq && !it.item().is(flag::BASE);
        let Some(other) = other.iter().find(is_same) else {
            continue;
        };
        items += 1;
        equal += usize::from(result_bytes(topic, own)? == result_bytes(topic, other)?);
        differences.extend(difference(topic, own, other)?);
    }
    let measured = summary(topic, &differences);
    let measured = measured.map_or_else(String::new, |measured| format!("; {measured}"));
    Ok(format!(
        "{equal} of {items} items are the same bytes{measured}"
    ))
}

/// Returns the mean of differences, in words.
fn summary(topic: &str, differences: &[Difference]) -> Option<String> {
    let items = differences.len().max(1) as f64;
    let mut sums = [0.0; 3];
    let mut all_points = [0; 2];
    for difference in differences {
        let values = match difference {
            Difference::Masks {
                mean_absolute,
                level,
                points,
            } => {
                (0..2).for_each(|i| all_points[i] += u64::from(points[i]));
                [*mean_absolute, *level, 0.0]
            }
            Difference::Planar { x_m, y_m, yaw_rad } => [x_m.powi(2), y_m.powi(2), yaw_rad.powi(2)],
        };
        (0..3).for_each(|i| sums[i] += values[i]);
    }
    let means = sums.map(|sum| sum / items);
    let [x_m, y_m, yaw_rad] = means.map(f64::sqrt);
    let yaw = format!("{:.4} deg in yaw", yaw_rad.to_degrees());
    match topic {
        Scan::TOPIC => None,
        Masked::TOPIC => Some(format!(
            "mean absolute difference of the rasters {:.4}, where the mean of our own is {:.4}; {} points to our {}",
            means[0], means[1], all_points[1], all_points[0]
        )),
        Rotation::TOPIC => Some(format!("RMS difference {yaw}")),
        _ => Some(format!(
            "RMS difference {x_m:.4} m in x, {y_m:.4} m in y, {yaw}"
        )),
    }
}
