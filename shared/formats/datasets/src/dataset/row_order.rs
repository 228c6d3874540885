//! The order of images whose names are no times: the order of the stamps of their first rows,
//! unless it mixes two clocks.

use std::{collections::BTreeSet, ffi::OsString};

use gyre_geometry::MAX_INTERVAL_NS;

use super::{
    first_image::FirstImage,
    image_list,
    images::Images,
    navtech_png::{METADATA_BYTES, RowMetadata},
    stamp,
};

const BY_TIME: &str = "The files are not named by times of their scans: they are ordered by the times of their first rows.";
const BY_NAME: &str = "The files are not named by times of their scans: they are in the order of their names, \
                       since in the order of the times of their first rows scans would overlap: a clock was set.";

/// Times of the first rows, ns since 1970, increasing unless a clock was set; the time of an
/// unreadable image is estimated. And sentences on the order.
type RowOrder = (Vec<i64>, Vec<String>);

/// Orders images by the stamps of their first rows, unless that mixes two clocks, and leaves out
/// images with a repeated stamp. Does nothing and returns `None` if their names are times of the
/// rows, or the rows have no times.
pub(crate) fn order(images: &mut Images, first_image: &FirstImage) -> Option<RowOrder> {
    let start_ns = first_image.row_ns(0).filter(|_| first_image.has_stamps())?;
    let is_named = |name_ns: i64| (name_ns - start_ns).abs() <= MAX_INTERVAL_NS;
    let all_named = (0..images.len()).all(|index| images.name_stamp_ns(index).is_some());
    if all_named && first_image.name_ns.is_some_and(is_named) {
        return None;
    }
    let stamp_ns = |index| {
        let bytes = images.first_bytes::<METADATA_BYTES>(index)?;
        stamp::to_ns(RowMetadata::parse(&bytes).stamp)
    };
    let stamps: Vec<Option<i64>> = (0..images.len()).map(stamp_ns).collect();
    let by_time = by_time(&stamps);
    let (order, sentence) = match is_mixed(&stamps, &by_time, first_image.turn().turn_ns()) {
        true => ((0..stamps.len()).collect(), BY_NAME),
        false => (by_time, BY_TIME),
    };
    let (indices, copies) = without_copies(&stamps, order);
    let starts_ns = filled(indices.iter().map(|index| stamps[*index]).collect())?;
    let name = |index: &usize| OsString::from(images.file(*index).file_name().unwrap_or_default());
    let copies: Vec<OsString> = copies.iter().map(name).collect();
    let same = image_list::note(&copies, "with the times of other images in the rows");
    images.keep(&indices);
    let notes = [Some(sentence.to_owned()), same].into_iter().flatten();
    Some((starts_ns, notes.collect()))
}

/// Returns the indices of images by their times. One without a time stays behind the one before it.
fn by_time(stamps: &[Option<i64>]) -> Vec<usize> {
    let mut last_ns = i64::MIN;
    let mut places: Vec<(i64, usize)> = Vec::with_capacity(stamps.len());
    for (index, stamp) in stamps.iter().enumerate() {
        last_ns = stamp.unwrap_or(last_ns);
        places.push((last_ns, index));
    }
    places.sort_unstable();
    places.into_iter().map(|(_, index)| index).collect()
}

/// Returns whether the order by time mixes scans of two clocks: scans of one radar cannot overlap,
/// and there more than a few would, and more than in the order of their names. `turn_ns` is the
/// duration of the rows of the first image.
fn is_mixed(stamps: &[Option<i64>], by_time: &[usize], turn_ns: Option<i64>) -> bool {
    let named: Vec<i64> = stamps.iter().copied().flatten().collect();
    let sorted: Vec<i64> = by_time.iter().filter_map(|index| stamps[*index]).collect();
    let turn_ns = turn_ns.filter(|ns| stamp::TURN_NS.contains(ns));
    // Both are too long rather than too short: names may leave out turns, and a row may be late.
    let turns = [turn_ns, stamp::turn_ns(named.iter().copied())];
    let Some(turn_ns) = turns.into_iter().flatten().min() else {
        return false;
    };
    // Copies are no scans that overlap.
    let overlaps = |times: &[i64]| {
        let steps = times.windows(2).map(|w| w[1] - w[0]);
        steps.filter(|ns| *ns != 0 && *ns < turn_ns / 2).count()
    };
    let found = overlaps(&sorted);
    found > 1 + sorted.len() / 100 && found > overlaps(&named)
}

/// Divides the indices of images into those in order, and those with the time of an earlier one.
fn without_copies(stamps: &[Option<i64>], order: Vec<usize>) -> (Vec<usize>, Vec<usize>) {
    let mut seen = BTreeSet::new();
    let is_first = |index: &usize| stamps[*index].is_none_or(|ns| seen.insert(ns));
    order.into_iter().partition(is_first)
}

/// Gives each image without a time the time of the image before plus a turn; `None` if no image has
/// a time.
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
        let (indices, copies) = without_copies(&stamps, by_time(&stamps));
        assert_eq!((indices, copies), (vec![0, 3, 5, 1, 2], vec![4]));
        let in_order = vec![None, Some(s), Some(2 * s), Some(3 * s), None];
        assert_eq!(filled(in_order), Some(vec![0, s, 2 * s, 3 * s, 4 * s]));
        assert_eq!(filled(vec![None, None]), None);
    }

    /// Times of the turns of these numbers, with up to 8 ms of jitter.
    fn turns(numbers: impl IntoIterator<Item = i64>) -> Vec<Option<i64>> {
        let ns = |k| k * stamp::DEFAULT_TURN_NS + k * 7 % 9 * 1_000_000;
        numbers.into_iter().map(ns).map(Some).collect()
    }

    #[test]
    fn an_order_by_time_in_which_scans_overlap_mixes_two_clocks() {
        let set = |back_ns| {
            let later = turns(20..40).into_iter();
            let later = later.map(|ns| ns.map(|ns: i64| ns - back_ns));
            [turns(0..20), later.collect()].concat()
        };
        let is_mixed = |stamps: &[_], turn_ns| is_mixed(stamps, &by_time(stamps), turn_ns);
        let known = [None, Some(0), Some(stamp::DEFAULT_TURN_NS)];
        for turn_ns in known {
            assert!(is_mixed(&set(3_100_000_000), turn_ns), "{turn_ns:?}");
            // Nothing overlaps: whether a clock was set, nobody knows.
            assert!(!is_mixed(&set(3_600 * stamp::SECOND_NS), turn_ns));
            // scan1, scan10, scan11, scan12, scan2, ...
            let text = [turns([1, 10, 11, 12]), turns(2..10)].concat();
            assert!(!is_mixed(&text, turn_ns), "{turn_ns:?}");
            assert!(!is_mixed(&turns((0..40).rev()), turn_ns), "{turn_ns:?}");
        }
        let turn_ns = known[2];
        for numbers in [&[1, 10, 2][..], &[2, 1, 3], &[3, 9, 1, 7, 5]] {
            assert!(!is_mixed(&turns(numbers.to_vec()), turn_ns), "{numbers:?}");
        }
        // Neither order is one: names are random, and two clocks overlap.
        let mixed = set(3_100_000_000);
        let random: Vec<_> = (0..40).map(|k| mixed[k * 17 % 40]).collect();
        assert!(!is_mixed(&random, turn_ns));
        // Copies do not overlap.
        assert!(!is_mixed(&[turns(0..20), turns(0..20)].concat(), turn_ns));
    }
}
