//! RADIATE: `Navtech_Polar/<frame>.png`, 576 rows of range x 400 columns of azimuth, and `Navtech_Polar.txt` with times.
//!
//! The times are `seconds.nanoseconds`, without leading zeros in the nanoseconds, and they are the times of receipt at the
//! host: after a stall they are late by up to 1.4 s while the antenna turns uniformly. The sensor clock is reconstructed.

use std::collections::BTreeMap;
use std::fs;
use std::path::Path;

use super::detect::Found;
use super::error::OpenError;
use super::images::Images;
use super::options::DatasetOptions;
use super::sensor_clock::SensorClock;
use super::stamp::{self, SECOND_NS};
use super::transposed::{TransposedScans, Turn};

/// Full range of the images, m.
const RANGE_M: f32 = 100.0;
/// Bounds of the period, ns: the radar turns four times per second.
const PERIOD_NS: std::ops::RangeInclusive<f64> = 0.2e9..=0.3e9;

const STAMPS: &str = "Logged stamps are times of receipt at the host; the sensor clock is the uniform series that touches them from \
                      below, columns are spread uniformly over its period, and the time of a scan is their mean.";

pub(crate) fn open(found: Found, options: &DatasetOptions) -> Result<TransposedScans, OpenError> {
    let list = found.folder.with_extension("txt");
    let io_error = |source| OpenError::Io {
        path: list.clone(),
        source,
    };
    let text = found
        .stamps
        .clone()
        .map_or_else(|| fs::read_to_string(&list).map_err(io_error), Ok)?;
    let (stamps, unpadded) = parse_stamps(&list, &text)?;
    let mut scans = TransposedScans::open(found, options, STAMPS, |bins| RANGE_M / bins as f32)?;
    scans.turns = turns(&scans.images, &stamps, &list)?;
    scans.period_ns = scans.turns.first().map_or(0, |turn| turn.period_ns);
    if unpadded > 0 {
        scans.notes.push(format!(
            "{unpadded} of {} stamps in {} have nanoseconds without leading zeros (.5 means 5 ns), and are read as integers; \
             read as decimals, time would run backwards.",
            stamps.len(),
            file_name(&list)
        ));
    }
    if stamps.len() > scans.turns.len() {
        scans.notes.push(format!(
            "{} lists {} scans, but there are {} images.",
            file_name(&list),
            stamps.len(),
            scans.turns.len()
        ));
    }
    Ok(scans)
}

/// Returns the sweeps on the reconstructed sensor clock.
fn turns(
    images: &Images,
    stamps: &BTreeMap<i64, i64>,
    list: &Path,
) -> Result<Vec<Turn>, OpenError> {
    let received = (0..images.len())
        .map(|index| receipt(images, index, stamps, list))
        .collect::<Result<Vec<_>, _>>()?;
    let clock = SensorClock::below(&received, PERIOD_NS).ok_or_else(|| OpenError::NoImages {
        path: images.file(0).to_owned(),
    })?;
    let turn = |&(frame, logged_ns): &(i64, i64)| Turn {
        start_ns: clock.start_ns(frame),
        period_ns: clock.period.round() as i64,
        logged_ns,
    };
    Ok(received.iter().map(turn).collect())
}

fn file_name(path: &Path) -> String {
    path.file_name()
        .map(|n| n.to_string_lossy().into_owned())
        .unwrap_or_default()
}

/// Frame number and time of receipt of an image.
fn receipt(
    images: &Images,
    index: usize,
    stamps: &BTreeMap<i64, i64>,
    list: &Path,
) -> Result<(i64, i64), OpenError> {
    let image = images.file(index);
    let missing = || {
        let reason = format!(
            "no time for {}; every image requires a line `Frame: <number> Time: <seconds>.<nanoseconds>`",
            file_name(image)
        );
        OpenError::Text {
            path: list.to_owned(),
            line: 0,
            reason,
        }
    };
    let frame = images.number(index).ok_or_else(missing)?;
    stamps
        .get(&frame)
        .map(|ns| (frame, *ns))
        .ok_or_else(missing)
}

/// Returns times by frame number, and how many of them lack leading zeros.
fn parse_stamps(path: &Path, text: &str) -> Result<(BTreeMap<i64, i64>, usize), OpenError> {
    let (mut stamps, mut unpadded) = (BTreeMap::new(), 0);
    for (line, content) in text
        .lines()
        .enumerate()
        .filter(|(_, l)| !l.trim().is_empty())
    {
        let (frame, ns, digits) = parse_line(content).ok_or_else(|| OpenError::Text {
            path: path.to_owned(),
            line: line + 1,
            reason: format!(
                "{content:?} is not `Frame: <number> Time: <seconds>.<nanoseconds>` of the years 2015 to 2040"
            ),
        })?;
        unpadded += usize::from(digits < 9);
        stamps.insert(frame, ns);
    }
    Ok((stamps, unpadded))
}

/// `Frame: 000248 Time: 1549986609.260809657`: number, ns, digits after the dot.
fn parse_line(line: &str) -> Option<(i64, i64, usize)> {
    let mut words = line.split_whitespace();
    let (frame, number, time, value) = (words.next()?, words.next()?, words.next()?, words.next()?);
    let (seconds, nanoseconds) = value.split_once('.')?;
    let ns: i64 = nanoseconds
        .parse()
        .ok()
        .filter(|ns| (0..SECOND_NS).contains(ns))?;
    let stamp = seconds
        .parse::<i64>()
        .ok()?
        .checked_mul(SECOND_NS)?
        .checked_add(ns)?;
    let labelled = frame == "Frame:" && time == "Time:" && stamp::plausible(stamp);
    labelled.then_some((number.parse().ok()?, stamp, nanoseconds.len()))
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    #[test]
    fn nanoseconds_without_leading_zeros_are_integers() {
        assert_eq!(
            parse_line("Frame: 000243 Time: 1549986608.1533537"),
            Some((243, 1_549_986_608_001_533_537, 7))
        );
        assert_eq!(
            parse_line("Frame: 1 Time: 1549986608.0"),
            Some((1, 1_549_986_608_000_000_000, 1))
        );
        for bad in [
            "Frame: 1 Time: 1549986608",
            "Frame: 1 Time: 1549986608.1234567890",
            "Frame: x Time: 1549986608.1",
            "Frame: 1 Time: 12.5",
            "",
        ] {
            assert_eq!(parse_line(bad), None, "{bad}");
        }
    }
}
