//! RADIATE: `Navtech_Polar/000001.png`, range downwards and azimuth to the right, without metadata;
//! and `Navtech_Polar.txt` with the receive times of the scans on the host. RADIATE has no exact
//! ground truth, so it is written as `ground_truth.tum`.

use std::fmt::Write as _;

use rand::Rng;

use crate::error::SimulatorError;
use crate::simulator::Simulator;
use crate::stream::Stream;

/// Sensor periods that a reader can recognise, microseconds.
const PERIODS_US: std::ops::RangeInclusive<i64> = 200_000..=300_000;

pub(crate) fn check(simulator: &Simulator) -> Result<(), SimulatorError> {
    let sampling = simulator.sampling();
    if PERIODS_US.contains(&sampling.period_us) && sampling.bins > sampling.azimuths {
        return Ok(());
    }
    let expected = format!(
        "oxford or boreas for {} azimuths x {} bins in {} us: readers of RADIATE expect more bins than azimuths and 0.2 to 0.3 s a turn",
        sampling.azimuths, sampling.bins, sampling.period_us
    );
    Err(SimulatorError::key("output.format", "radiate", expected))
}

/// Probability that the host loses an azimuth: as in a recording, where 46 % of the scans have lost
/// one or more.
const LOST: f64 = 0.0015;

pub(crate) fn lost_azimuths(simulator: &Simulator, index: usize) -> Vec<usize> {
    if index == 0 || !simulator.config().sensor.lost_azimuths {
        return Vec::new();
    }
    let mut rng = Stream::lost(index as u64).generator(simulator.config().sensor_seed());
    let azimuths = 0..simulator.sampling().azimuths;
    azimuths.filter(|_| rng.random_bool(LOST)).collect()
}

/// Loses azimuths of an image, range downwards: the columns behind each move up by one, and the
/// last ones keep the content of the image before.
pub(crate) fn lose(pixels: &mut [u8], before: &[u8], columns: usize, azimuths: &[usize]) {
    let measured = columns - azimuths.len();
    let rows = pixels.chunks_exact_mut(columns);
    for (row, before) in rows.zip(before.chunks_exact(columns)) {
        let kept = (0..columns).filter(|column| !azimuths.contains(column));
        for (to, from) in kept.enumerate() {
            row[to] = row[from];
        }
        row[measured..].copy_from_slice(&before[measured..]);
    }
}

pub(crate) fn file_name(index: usize) -> String {
    format!("{:06}.png", index + 1)
}

/// The scan's time, nanoseconds since 1970: the mean over its columns, whose times are evenly
/// spaced over a turn.
pub(crate) fn stamp_ns(simulator: &Simulator, index: usize) -> i64 {
    let (time, azimuths) = (simulator.time(index), simulator.sampling().azimuths as i64);
    time.start_us * 1000 + time.period_us * 1000 * (azimuths - 1) / (2 * azimuths)
}

/// `Navtech_Polar.txt`: the nanoseconds follow the dot *without leading zeros*.
pub(crate) fn stamps(simulator: &Simulator) -> String {
    let mut text = String::new();
    for index in 0..simulator.scans() {
        let start_us = simulator.time(index).start_us;
        let (seconds, rest_us) = (start_us / 1_000_000, start_us % 1_000_000);
        let _ = writeln!(
            text,
            "Frame: {:06} Time: {seconds}.{}",
            index + 1,
            rest_us * 1000
        );
    }
    text
}

/// Transposes rows of `stride` bytes: `into[bin][azimuth] = rows[azimuth][first_byte + bin]`.
pub(crate) fn transpose(rows: &[u8], stride: usize, first_byte: usize, into: &mut [u8]) {
    let azimuths = rows.len() / stride;
    // Eight rows at a time, so that each line of the image is written in runs.
    for (group, rows) in rows.chunks(8 * stride).enumerate() {
        for (bin, line) in into.chunks_exact_mut(azimuths).enumerate() {
            for (row, to) in rows.chunks_exact(stride).zip(&mut line[8 * group..]) {
                *to = row[first_byte + bin];
            }
        }
    }
}
