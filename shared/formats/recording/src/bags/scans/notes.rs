//! Sentences on a bag.

use super::index::Index;
use crate::bags::{
    azimuths::Described,
    bag::{Bag, CountsOrigin, Origin, RadarOrigin},
    topics::Topics,
};

/// Returns notes on the radar and on missing data: whole sentences.
pub(super) fn notes(
    bag: &Bag,
    topics: &Topics,
    described: &Described,
    origin: &Origin,
    index: &Index,
) -> Vec<String> {
    let (scans, radar) = (&topics.scans.name, of_radar(described, origin));
    let mut notes = vec![format!("Scans are on {scans}{radar}.")];
    notes.extend(index.notes());
    let damage = bag.files.iter().filter_map(|file| file.damage(true));
    notes.extend(damage.map(|sentence| format!("{sentence}.")));
    notes
}

fn of_radar(described: &Described, origin: &Origin) -> String {
    let radar = &described.radar;
    let found = format!(
        "{} azimuths of {} bins",
        radar.azimuth_samples, radar.range_in_bins
    );
    let (found, itself) = match &origin.radar {
        RadarOrigin::Itself => (format!(", {found} as the radar says of itself"), true),
        RadarOrigin::Scans { refused: None } => (
            format!("; the radar does not describe itself in the bag: {found} are as found"),
            false,
        ),
        RadarOrigin::Scans {
            refused: Some(reason),
        } => (
            format!(
                "; what the radar says of itself cannot be used ({reason}): {found} are as found"
            ),
            false,
        ),
    };
    let counts = match origin.counts {
        CountsOrigin::Configured => " as configured".to_owned(),
        CountsOrigin::Usual if itself => " as it says too".to_owned(),
        CountsOrigin::Usual => " as most radars have".to_owned(),
        CountsOrigin::Azimuths { usual } => {
            let usual = match itself {
                true => format!(", not {usual} as it says"),
                false => format!(", not {usual}"),
            };
            format!(
                "{usual}: with these the step from the last azimuth to the first is as the others"
            )
        }
    };
    let size = radar.encoder_size;
    format!("{found}, {size} encoder counts per turn{counts}")
}
