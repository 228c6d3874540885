//! Sentences on the properties of the first image of Navtech scans.

use super::first_image::FirstImage;
use super::format::Format;
use super::navtech_png::ByteTen;
use super::options::AzimuthSource;
use super::profiles::Profile;

/// Observations on the first image.
pub(super) fn observations(image: &FirstImage, format: Format, profile: &Profile) -> Vec<String> {
    let named = image.named_by().filter(|by| *by != profile.named_by).map(|by| {
        let expected = profile.named_by.description();
        format!(
            "The files are named by {}, but {format} files by {expected}: the format may be another one.",
            by.description()
        )
    });
    [
        note_bursts(image, profile),
        note_byte_ten(image, profile),
        note_uniform(profile),
        named,
    ]
    .into_iter()
    .flatten()
    .collect()
}

fn note_bursts(image: &FirstImage, profile: &Profile) -> Option<String> {
    let (min, max, mean) = image.row_intervals_ns()?;
    let handling = if profile.smooth_stamps {
        "replaced by a linear fit over the azimuth"
    } else {
        "used as they are"
    };
    (max > 4 * mean.max(1)).then(|| {
        format!(
            "Row stamps come in bursts ({} to {} us apart, {} us on average), as packets are received: they are {handling}.",
            min / 1000,
            max / 1000,
            mean / 1000
        )
    })
}

fn note_byte_ten(image: &FirstImage, profile: &Profile) -> Option<String> {
    if image.chirps_alternate() {
        return Some("Byte 10 alternates from row to row: it is the direction of the chirp (255 up, 0 down), not validity; no row is dropped.".to_owned());
    }
    (image.byte_ten_is_zero() && profile.byte_ten == ByteTen::Unused).then(|| {
        "Byte 10 is 0 in every row: it gives neither validity nor chirps, and all rows count as measured."
            .to_owned()
    })
}

fn note_uniform(profile: &Profile) -> Option<String> {
    (profile.azimuth_source == AzimuthSource::Uniform).then(|| {
        "Azimuths are taken as uniformly spaced from straight ahead; the encoder columns are not used.".to_owned()
    })
}

/// Returns a sentence on counts per turn that are configured, if the rows show other ones.
pub(super) fn note_encoder(image: &FirstImage, profile: &Profile) -> Option<String> {
    let counts = profile.encoder_counts;
    let step = image.turn().step().filter(|step| !step.fits(counts))?;
    let (seam, size) = (step.seam(counts)?, step.size()?);
    Some(format!(
        "The encoder steps by {} counts per row and by {seam} from the last row to the first, with {counts} counts per turn: \
         `encoder_counts = {size}` would make the steps equal, and change azimuths by up to {:.2} deg.",
        step.step,
        360.0 * (f64::from(size) / f64::from(counts) - 1.0).abs()
    ))
}
