//! The order of images whose names are no times: that of the stamps of their first rows.

use std::collections::BTreeSet;
use std::ffi::OsString;

use super::first_image::FirstImage;
use super::image_list;
use super::images::Images;
use super::navtech_png::{METADATA_BYTES, RowMetadata};
use super::stamp;
use crate::chain::MAX_INTERVAL_NS;

/// The times of the first rows of images, and what is to be said of them.
#[derive(Debug)]
pub(crate) struct RowOrder {
    /// ns since 1970, increasing. That of an image that cannot be read is about where it would be.
    pub(crate) starts_ns: Vec<i64>,
    pub(crate) notes: Vec<String>,
}

/// Orders images by the stamps of their first rows, and leaves out those with the stamp of another
/// one. Does nothing and returns `None` if their names are times of the rows, or the rows have no
/// times.
pub(crate) fn order(images: &mut Images, first_image: &FirstImage) -> Option<RowOrder> {
    let start_ns = first_image.has_stamps().then(|| first_image.start_ns())??;
    let is_named = |name_ns: i64| (name_ns - start_ns).abs() <= MAX_INTERVAL_NS;
    let all_named = (0..images.len()).all(|index| images.name_stamp_ns(index).is_some());
    if all_named && first_image.name_ns().is_some_and(is_named) {
        return None;
    }
    let stamps: Vec<Option<i64>> = (0..images.len())
        .map(|index| {
            let bytes = images.first_bytes::<METADATA_BYTES>(index)?;
            stamp::to_ns(RowMetadata::parse(&bytes).stamp)
        })
        .collect();
    let (indices, copies) = ordered(&stamps);
    let starts_ns = filled(indices.iter().map(|index| stamps[*index]).collect())?;
    let name = |index: &usize| OsString::from(images.file(*index).file_name().unwrap_or_default());
    let copies: Vec<OsString> = copies.iter().map(name).collect();
    let same = image_list::note(&copies, "with the times of other images in the rows");
    images.keep(&indices);
    let named = "The files are not named by times of their scans: they are ordered by the times of their first rows.";
    Some(RowOrder {
        starts_ns,
        notes: [Some(named.to_owned()), same]
            .into_iter()
            .flatten()
            .collect(),
    })
}

/// Returns the indices of images by their times, and those of images with the time of an earlier
/// one. One without a time stays behind the one before it.
fn ordered(stamps: &[Option<i64>]) -> (Vec<usize>, Vec<usize>) {
    let mut last_ns = i64::MIN;
    let mut places: Vec<(i64, usize)> = Vec::with_capacity(stamps.len());
    for (index, stamp) in stamps.iter().enumerate() {
        last_ns = stamp.unwrap_or(last_ns);
        places.push((last_ns, index));
    }
    places.sort_unstable();
    let mut seen = BTreeSet::new();
    let is_first = |index: &usize| stamps[*index].is_none_or(|ns| seen.insert(ns));
    places
        .into_iter()
        .map(|(_, index)| index)
        .partition(is_first)
}

/// Gives images without a time one, a turn after that of the image before; `None` if none has one.
fn filled(stamps: Vec<Option<i64>>) -> Option<Vec<i64>> {
    let known = || stamps.iter().copied().flatten();
    let turn_ns = stamp::turn_ns(known()).unwrap_or(stamp::DEFAULT_TURN_NS);
    let first = stamps.iter().position(Option::is_some)? as i64;
    let mut next_ns = known().next()? - first * turn_ns;
    let filled = stamps.iter().map(|stamp| {
        let ns = stamp.unwrap_or(next_ns);
        next_ns = ns + turn_ns;
        ns
    });
    Some(filled.collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn images_without_a_time_stay_behind_the_one_before_and_copies_are_left_out() {
        let s = stamp::SECOND_NS;
        let stamps = [None, Some(3 * s), None, Some(s), Some(3 * s), Some(2 * s)];
        let (indices, copies) = ordered(&stamps);
        assert_eq!((indices, copies), (vec![0, 3, 5, 1, 2], vec![4]));
        let in_order = vec![None, Some(s), Some(2 * s), Some(3 * s), None];
        assert_eq!(filled(in_order), Some(vec![0, s, 2 * s, 3 * s, 4 * s]));
        assert_eq!(filled(vec![None, None]), None);
    }
}
