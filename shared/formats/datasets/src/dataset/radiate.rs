//! RADIATE: `Navtech_Polar/<frame>.png`, 576 rows of range x 400 columns of azimuth, and
//! `Navtech_Polar.txt` with times.
//!
//! The times are `seconds.nanoseconds`, without leading zeros in the nanoseconds, of receipt at the
//! host: after a stall they are late by up to 1.4 s. The sensor clock is reconstructed.

use std::{
    collections::{BTreeMap, BTreeSet},
    io::ErrorKind,
    path::Path,
};

use gyre_geometry::MAX_INTERVAL_NS;
use gyre_storage::quoted;

use super::{
    detect::Found,
    error::OpenError,
    images::Images,
    options::DatasetOptions,
    sensor_clock::SensorClock,
    stamp::{self, SECOND_NS},
    transposed::{StaleRows, TransposedScans, Turn},
};

/// The largest list of stamps: months of scans.
const MAX_LIST_BYTES: u64 = 1 << 30;
const RANGE_M: f32 = 100.0;
/// Bounds of the period, ns: the radar turns four times per second.
const PERIOD_NS: std::ops::RangeInclusive<f64> = 0.2e9..=0.3e9;

const STAMPS: &str = "Logged stamps are times of receipt at the host; the sensor clock is the uniform series that touches them from \
                      below, columns are spread uniformly over its period, and the time of a scan is their mean.";

pub(crate) fn open(found: Found, options: &DatasetOptions) -> Result<TransposedScans, OpenError> {
    let list = found.folder.with_extension("txt");
    let text = match &found.stamps {
        Some(text) => text.clone(),
        None => read_list(&list)?,
    };
    let stamps = parse_stamps(&list, &text)?;
    let mut scans = TransposedScans::open(found, options, STAMPS, |bins| RANGE_M / bins as f32)?;
    scans.stale = scans.stale.map(StaleRows::of_compressed);
    add_turns(&mut scans, &stamps, &list)?;
    if stamps.len() > scans.turns.len() {
        scans.properties.notes.push(format!(
            "{} lists {} scans, but there are {} images.",
            file_name(&list),
            stamps.len(),
            scans.turns.len()
        ));
    }
    Ok(scans)
}

/// Reads a list of `Frame: <number> Time: <seconds>.<nanoseconds>`: the times by frame number, ns.
pub fn frame_stamps(list: &Path) -> Result<BTreeMap<i64, i64>, OpenError> {
    parse_stamps(list, &read_list(list)?)
}

fn read_list(list: &Path) -> Result<String, OpenError> {
    gyre_storage::read_text(list, MAX_LIST_BYTES).map_err(|source| match source.kind() {
        ErrorKind::NotFound => OpenError::Recording(format!(
            "there is no {}: it lists the times of the files in the folder beside it, which have none of their own; copy it from the dataset",
            list.display()
        )),
        _ => OpenError::io(list, source),
    })
}

/// A frame number and a time of receipt, ns.
type Receipt = (i64, i64);

/// Divides the frames where the time between two of them contradicts their numbers, as after a
/// pause or when the clock was set. A single time that is off is left out.
fn segments(received: &[Receipt]) -> Vec<Vec<Receipt>> {
    let mut segments: Vec<Vec<Receipt>> = Vec::new();
    for (index, receipt) in received.iter().enumerate() {
        let next = received.get(index + 1);
        let open = segments.last_mut();
        match open.and_then(|segment| Some((*segment.last()?, segment))) {
            Some((last, segment)) if agree(last, *receipt) => segment.push(*receipt),
            Some((last, _)) if next.is_some_and(|next| agree(last, *next)) => {}
            _ => segments.push(vec![*receipt]),
        }
    }
    segments
}

fn agree(earlier: Receipt, later: Receipt) -> bool {
    let frames = later.0.saturating_sub(earlier.0) as f64;
    let apart_ns = later.1.saturating_sub(earlier.1) as f64;
    let bounds = (frames * PERIOD_NS.start() - MAX_INTERVAL_NS as f64)
        ..=(frames * PERIOD_NS.end() + MAX_INTERVAL_NS as f64);
    bounds.contains(&apart_ns)
}

/// Adds the sweeps on the reconstructed sensor clock, and notes on times that cannot be used.
fn add_turns(
    scans: &mut TransposedScans,
    stamps: &BTreeMap<i64, i64>,
    list: &Path,
) -> Result<(), OpenError> {
    let received = receipts(&scans.images, stamps, list)?;
    let segments = segments(&received);
    let mut used: BTreeSet<i64> = BTreeSet::new();
    let (mut clocks, mut early) = (Vec::new(), Vec::new());
    for receipts in &segments {
        let Some((clock, ignored)) = SensorClock::below_most(receipts, PERIOD_NS) else {
            continue;
        };
        let others = receipts.iter().filter(|receipt| !ignored.contains(receipt));
        used.extend(others.map(|receipt| receipt.0));
        let by_s = |receipt: Receipt| (receipt.0, -clock.after_ns(receipt) * 1e-9);
        early.extend(ignored.into_iter().map(by_s));
        clocks.push((receipts[0].0, clock));
    }
    let turn = |&(frame, logged_ns): &Receipt| {
        let later = clocks.partition_point(|(first, _)| *first <= frame);
        let (_, clock) = clocks.get(later.checked_sub(1)?)?;
        let start_ns = clock.start_ns(frame);
        let is_used = used.contains(&frame);
        Some(Turn {
            start_ns,
            period_ns: clock.period.round() as i64,
            logged_ns: if is_used { logged_ns } else { start_ns },
        })
    };
    scans.turns = received.iter().filter_map(turn).collect();
    scans.properties.period_ns = scans.turns.first().map_or(0, |turn| turn.period_ns);
    let is_early = |frame: &i64| early.iter().any(|(other, _)| other == frame);
    let far = received.iter().map(|(frame, _)| frame);
    let far = far.filter(|frame| !used.contains(*frame) && !is_early(frame));
    let far: Vec<String> = far.map(ToString::to_string).collect();
    let notes = note_times(&far, &early, segments.len(), list);
    scans.properties.notes.extend(notes);
    Ok(())
}

/// Returns sentences on the frames whose times are far off, on those whose times are early by some
/// seconds, and on breaks.
fn note_times(far: &[String], early: &[(i64, f64)], segments: usize, list: &Path) -> Vec<String> {
    let (list, limit_s) = (file_name(list), MAX_INTERVAL_NS / SECOND_NS);
    let far = (!far.is_empty()).then(|| {
        let frames = far.join(", ");
        format!("{} times in {list} are more than {limit_s} s from those before and after (frames {frames}): the frame number is used instead.", far.len())
    });
    let early = (!early.is_empty()).then(|| {
        let frames = early.iter().map(|(frame, s)| format!("{frame} by {s:.2} s"));
        let frames = frames.collect::<Vec<_>>().join(", ");
        format!("{} times in {list} are before their scans were measured, by all others (frames {frames}): the frame number is used instead.", early.len())
    });
    let breaks = (segments > 1).then(|| {
        let breaks = segments - 1;
        format!("The times in {list} break {breaks} times by more than {limit_s} s: the sensor clock starts anew there.")
    });
    [far, early, breaks].into_iter().flatten().collect()
}

fn file_name(path: &Path) -> String {
    let name = path.file_name().unwrap_or_default();
    name.to_string_lossy().into_owned()
}

fn receipts(
    images: &Images,
    stamps: &BTreeMap<i64, i64>,
    list: &Path,
) -> Result<Vec<Receipt>, OpenError> {
    let receipt = |index| {
        let frame = images.number(index)?;
        Some((frame, *stamps.get(&frame)?))
    };
    let found: Vec<Option<Receipt>> = (0..images.len()).map(receipt).collect();
    let missing = || (0..found.len()).filter(|index| found[*index].is_none());
    let Some(first) = missing().next() else {
        return Ok(found.into_iter().flatten().collect());
    };
    let (missing, all, first) = (
        missing().count(),
        images.len(),
        file_name(images.file(first)),
    );
    let fault = format!(
        "has no times of {missing} of {all} images, {first} first; every image needs a line `Frame: <number> Time: <seconds>.<nanoseconds>`: copy the whole list, or take these images away"
    );
    Err(OpenError::at(list, fault))
}

fn parse_stamps(path: &Path, text: &str) -> Result<BTreeMap<i64, i64>, OpenError> {
    let mut stamps = BTreeMap::new();
    let lines = text.lines().enumerate();
    for (line, content) in lines.filter(|(_, content)| !content.trim().is_empty()) {
        let (frame, ns) = parse_line(content).ok_or_else(|| {
            OpenError::Recording(format!(
                "{}, line {}: {} is not `Frame: <number> Time: <seconds>.<nanoseconds>` of the years 2015 to 2040",
                path.display(),
                line + 1,
                quoted(content)
            ))
        })?;
        stamps.insert(frame, ns);
    }
    Ok(stamps)
}

/// `Frame: 000248 Time: 1549986609.260809657`: number, ns.
fn parse_line(line: &str) -> Option<Receipt> {
    let mut words = line.split_whitespace();
    let (frame, number, time, value) = (words.next()?, words.next()?, words.next()?, words.next()?);
    let (seconds, nanoseconds) = value.split_once('.')?;
    let ns = nanoseconds.parse::<i64>().ok();
    let ns = ns.filter(|ns| (0..SECOND_NS).contains(ns))?;
    let seconds: i64 = seconds.parse().ok()?;
    let stamp = seconds.checked_mul(SECOND_NS)?.checked_add(ns)?;
    let labelled = frame == "Frame:" && time == "Time:" && stamp::plausible(stamp);
    labelled.then_some((number.parse().ok()?, stamp))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nanoseconds_without_leading_zeros_are_integers() {
        let line = parse_line("Frame: 000243 Time: 1549986608.1533537");
        assert_eq!(line, Some((243, 1_549_986_608_001_533_537)));
        let line = parse_line("Frame: 1 Time: 1549986608.0");
        assert_eq!(line, Some((1, 1_549_986_608_000_000_000)));
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

    fn received(frames: std::ops::Range<i64>, offset_ns: i64) -> Vec<Receipt> {
        let ns = |frame| 1_549_986_607_000_000_000 + frame * 250_000_000 + offset_ns;
        frames.map(|frame| (frame, ns(frame))).collect()
    }

    #[test]
    fn a_pause_starts_a_new_clock() {
        for pause_ns in [-3_600, 3_600].map(|s| s * SECOND_NS) {
            let frames = [received(0..10, 0), received(10..20, pause_ns)].concat();
            let found = segments(&frames);
            let sizes: Vec<_> = found.iter().map(|s| (s[0].0, s.len())).collect();
            assert_eq!(sizes, [(0, 10), (10, 10)]);
        }
    }
}
