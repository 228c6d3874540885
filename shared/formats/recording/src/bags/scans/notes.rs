//! Sentences on a bag.

use super::index::Index;
use crate::bags::{
    azimuths::Described,
    bag::{Bag, CountsOrigin, Origin},
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
    let found = match &origin.refused {
        _ if origin.is_own => format!(", {found} as the radar says of itself"),
        None => {
            format!("; the radar does not describe itself in the bag: {found} are as found")
        }
        Some(reason) => format!(
            "; what the radar says of itself cannot be used ({reason}): {found} are as found"
        ),
    };
    let said = if origin.is_own { " as it says" } else { "" };
    let counts = match origin.counts {
        CountsOrigin::Configured => " as configured".to_owned(),
        CountsOrigin::Usual if origin.is_own => " as it says too".to_owned(),
        CountsOrigin::Usual => " as most radars have".to_owned(),
        CountsOrigin::Azimuths { usual } => format!(
            ", not {usual}{said}: with these the step from the last azimuth to the first is as the others"
        ),
    };
    let size = radar.encoder_size;
    format!("{found}, {size} encoder counts per turn{counts}")
}
