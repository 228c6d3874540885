//! Sentences on the properties of the first image of Navtech scans.

use super::first_image::FirstImage;
use super::format::Format;
use super::navtech_png::ByteTen;
use super::options::AzimuthSource;
use super::profiles::Profile;

pub(super) fn observations(image: &FirstImage, format: Format, profile: &Profile) -> Vec<String> {
    let mut notes: Vec<String> = note_bursts(image, profile).into_iter().collect();
    if image.chirps_alternate() {
        notes.push("Byte 10 alternates from row to row: it is the direction of the chirp (255 up, 0 down), not validity; no row is dropped.".to_owned());
    } else if image.byte_ten_is_zero() && profile.byte_ten == ByteTen::Unused {
        notes.push("Byte 10 is 0 in every row: it gives neither validity nor chirps, and all rows count as measured.".to_owned());
    }
    if profile.azimuth_source == AzimuthSource::Uniform {
        notes.push("Azimuths are taken as uniformly spaced from straight ahead; the encoder columns are not used.".to_owned());
    }
    if let Some(by) = image.named_by().filter(|by| *by != profile.named_by) {
        let (named, expected) = (by.description(), profile.named_by.description());
        notes.push(format!(
            "The files are named by {named}, but {format} files by {expected}: the format may be a different one."
        ));
    }
    notes
}

fn note_bursts(image: &FirstImage, profile: &Profile) -> Option<String> {
    let (min, max, mean) = image.row_intervals_ns()?;
    let handling = match profile.smooth_stamps {
        true => "replaced by a linear fit over the azimuth",
        false => "used as they are",
    };
    let [min_us, max_us, mean_us] = [min, max, mean].map(|ns| ns / 1000);
    (max > 4 * mean.max(1)).then(|| {
        format!(
            "Row stamps come in bursts ({min_us} to {max_us} us apart, {mean_us} us on average), as packets are received: they are {handling}."
        )
    })
}
