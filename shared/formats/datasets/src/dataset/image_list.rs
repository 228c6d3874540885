//! The image files of a folder: the scans of one series, in order.

use std::cmp::Ordering;
use std::collections::HashSet;
use std::ffi::OsString;
use std::fs::{self, DirEntry};
use std::io;
use std::path::{Path, PathBuf};

use super::error::OpenError;
use super::stamp;

const MAX_NAMED: usize = 4;

#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
enum SeriesPosition {
    Time(i64),
    Number(i64),
    Name,
}

impl SeriesPosition {
    fn of(name: &Path) -> Self {
        match file_number(name) {
            Some(number) => stamp::to_ns(number).map_or(Self::Number(number), Self::Time),
            None => Self::Name,
        }
    }
}

/// Lists the images of a folder that are one series: ordered by the times or the numbers that they
/// are named by, otherwise by name.
///
/// Left out are hidden files, copies of a numbered image, whatever is named otherwise than at least
/// half of the images, and a second file of the same number: a sentence names them.
pub(crate) fn list(folder: &Path) -> Result<(Vec<PathBuf>, Option<String>), OpenError> {
    let io_error = |source| OpenError::io(folder, source);
    let mut names: Vec<OsString> = Vec::new();
    for entry in fs::read_dir(folder).map_err(io_error)? {
        names.extend(png_name(&entry.map_err(io_error)?).map_err(io_error)?);
    }
    let (names, mut others) = series(names);
    others.sort_unstable();
    let files = names.iter().map(|name| folder.join(name)).collect();
    Ok((files, note(&others, "not of the series by name")))
}

pub(crate) fn note(left_out: &[OsString], because: &str) -> Option<String> {
    let named = left_out.iter().take(MAX_NAMED);
    let named = named.map(|name| format!("`{}`", name.to_string_lossy()));
    let mut named = named.collect::<Vec<_>>().join(", ");
    if left_out.len() > MAX_NAMED {
        named += &format!(" and {} more", left_out.len() - MAX_NAMED);
    }
    let are = match left_out.len() {
        0 => return None,
        1 => "1 image is".to_owned(),
        n => format!("{n} images are"),
    };
    Some(format!("{are} left out, {because}: {named}."))
}

/// Divides names into the names of the series, in order, and the others.
fn series(names: Vec<OsString>) -> (Vec<OsString>, Vec<OsString>) {
    let (hidden, shown): (Vec<_>, Vec<_>) = names.into_iter().partition(is_hidden);
    let numbers = shown.iter().filter_map(|name| file_number(Path::new(name)));
    let numbers: HashSet<i64> = numbers.collect();
    let is_copy =
        |name: &OsString| copied_number(name).is_some_and(|number| numbers.contains(&number));
    let (copies, shown): (Vec<_>, Vec<_>) = shown.into_iter().partition(is_copy);
    let placed = |name: OsString| (SeriesPosition::of(Path::new(&name)), name);
    let (mut placed, strangers) = most(shown.into_iter().map(placed).collect());
    placed.sort_unstable_by(|(a, one), (b, other)| a.cmp(b).then_with(|| natural(one, other)));
    let (mut kept, mut others) = (Vec::<OsString>::new(), [hidden, copies, strangers].concat());
    let mut last = None;
    for (place, name) in placed {
        match place != SeriesPosition::Name && last.replace(place) == Some(place) {
            true => others.push(name),
            false => kept.push(name),
        }
    }
    (kept, others)
}

/// Returns the images that are named as at least half of them are: by times, else by numbers, else
/// all of them; and the others.
fn most(
    placed: Vec<(SeriesPosition, OsString)>,
) -> (Vec<(SeriesPosition, OsString)>, Vec<OsString>) {
    let half = |is_one: fn(&SeriesPosition) -> bool| {
        let count = placed.iter().filter(|(place, _)| is_one(place)).count();
        2 * count >= placed.len()
    };
    let by_time: fn(&SeriesPosition) -> bool = |place| matches!(place, SeriesPosition::Time(_));
    let by_number: fn(&SeriesPosition) -> bool = |place| *place != SeriesPosition::Name;
    let is_one: fn(&SeriesPosition) -> bool = match (half(by_time), half(by_number)) {
        (true, _) => by_time,
        (false, true) => by_number,
        (false, false) => |_| true,
    };
    let (kept, others): (Vec<_>, Vec<_>) = placed.into_iter().partition(|(place, _)| is_one(place));
    (kept, others.into_iter().map(|(_, name)| name).collect())
}

/// `._NAME.png` is what macOS stores of a file beside it on file systems of others.
fn is_hidden(name: &OsString) -> bool {
    name.as_encoded_bytes().starts_with(b".")
}

/// Returns the number that a name begins with, where a word follows it: `12 (1).png`,
/// `12-copy.png`.
fn copied_number(name: &OsString) -> Option<i64> {
    let stem = Path::new(name).file_stem()?.to_str()?;
    let digits = stem.find(|c: char| !c.is_ascii_digit())?;
    stem[..digits].parse().ok()
}

/// Compares names, and numbers in them as numbers: `scan2` is before `scan10`.
fn natural(one: &OsString, other: &OsString) -> Ordering {
    let stem = |name| {
        let stem = Path::new(name).file_stem();
        stem.unwrap_or_default().as_encoded_bytes()
    };
    let (mut a, mut b) = (stem(one), stem(other));
    while let (Some(first), Some(second)) = (a.first(), b.first()) {
        let order = match (number_in(a), number_in(b)) {
            (Some((m, rest_a)), Some((n, rest_b))) => {
                (a, b) = (rest_a, rest_b);
                m.len().cmp(&n.len()).then_with(|| m.cmp(n))
            }
            _ => {
                (a, b) = (&a[1..], &b[1..]);
                first.cmp(second)
            }
        };
        if order != Ordering::Equal {
            return order;
        }
    }
    a.len().cmp(&b.len()).then_with(|| one.cmp(other))
}

/// Splits the digits off the start of a text, without leading zeros.
fn number_in(text: &[u8]) -> Option<(&[u8], &[u8])> {
    let end = text.iter().position(|b| !b.is_ascii_digit());
    let end = end.unwrap_or(text.len());
    let (digits, rest) = text.split_at(end);
    let zeros = digits.iter().take_while(|b| **b == b'0').count();
    (end > 0).then(|| (&digits[zeros..], rest))
}

/// Returns whether a folder exists and holds a PNG that is not hidden.
pub(crate) fn has_png(folder: &Path) -> bool {
    let entries = fs::read_dir(folder).into_iter().flatten().flatten();
    let mut names = entries.map(|entry| png_name(&entry));
    names.any(|name| matches!(name, Ok(Some(name)) if !is_hidden(&name)))
}

fn png_name(entry: &DirEntry) -> io::Result<Option<OsString>> {
    let name = entry.file_name();
    let extension = Path::new(&name).extension();
    if !extension.is_some_and(|extension| extension.eq_ignore_ascii_case("png")) {
        return Ok(None);
    }
    // The listing contains the type of an entry. Only a link must be followed, which costs a system
    // call.
    let kind = entry.file_type()?;
    let is_file = kind.is_file() || (kind.is_symlink() && entry.path().is_file());
    Ok(is_file.then_some(name))
}

pub(crate) fn file_number(path: &Path) -> Option<i64> {
    path.file_stem()?.to_str()?.parse().ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn divided(names: &[&str]) -> (Vec<String>, Vec<String>) {
        let text = |names: Vec<OsString>| -> Vec<String> {
            let stem = |name: &OsString| name.to_string_lossy().trim_end_matches(".png").to_owned();
            names.iter().map(stem).collect()
        };
        let names = names.iter().map(|name| format!("{name}.png").into());
        let (kept, others) = series(names.collect());
        (text(kept), text(others))
    }

    #[test]
    fn images_are_in_the_order_of_their_times_or_numbers() {
        assert_eq!(divided(&["10", "000009", "-1"]).0, ["-1", "000009", "10"]);
        // One time in ns among those in us.
        let times = [
            "1547131046600000",
            "1547131046350000000",
            "1547131046100000",
        ];
        assert_eq!(divided(&times).0, [times[2], times[1], times[0]]);
    }

    #[test]
    fn of_two_files_of_one_frame_one_is_left_out() {
        let (kept, others) = divided(&["000001", "1", "2"]);
        assert_eq!(kept, ["000001", "2"]);
        assert_eq!(others, ["1"]);
    }
}
