//! Rates of the samples of other sensors, by the scans that they come with.

use std::collections::VecDeque;

use gyre_geometry::samples::{Sample, SampleKind};
use serde::{Serialize, Serializer, ser::SerializeMap};

use gyre_geometry::samples::Witness;

use crate::scan::ScanHeader;

/// Scans for measuring rates: ten seconds at 4 Hz.
const SCANS: usize = 41;
const KINDS: usize = Witness::ALL.len();

#[derive(Clone, Debug, Default)]
pub struct SampleRates {
    /// The end of each of the last scans, ns, with the new samples of each kind.
    scans: VecDeque<(i64, [u64; KINDS])>,
    /// The newest stamp of each kind: samples come with two scans.
    newest_ns: [Option<i64>; KINDS],
    counts: [u64; KINDS],
    left_out: u64,
}

#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct SampleHealth {
    /// Samples of each kind, in the order of [`Witness::ALL`].
    pub counts: [u64; KINDS],
    /// Samples that were left out, since they came late or were unusable.
    pub left_out: u64,
    /// Samples of each kind a second by the stamps of the last scans; `None` without samples so
    /// far.
    pub rates_hz: [Option<f64>; KINDS],
}

impl Serialize for SampleHealth {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let mut map = serializer.serialize_map(None)?;
        for (kind, _) in Witness::sampled() {
            map.serialize_entry(kind.name(), &self.counts[kind as usize])?;
        }
        map.serialize_entry("left_out", &self.left_out)?;
        for (kind, _) in Witness::sampled() {
            let key = format!("{}_hz", kind.name());
            map.serialize_entry(&key, &self.rates_hz[kind as usize])?;
        }
        map.end()
    }
}

impl SampleRates {
    /// Takes a scan with its payload; one that was taken before is left out.
    pub fn add(&mut self, header: &ScanHeader, bytes: &[u8]) {
        let [_, end_ns] = header.span_ns();
        if self.scans.back().is_some_and(|(last, _)| end_ns <= *last) {
            return;
        }
        let samples = header.samples(bytes).unwrap_or_default();
        let mut new = [0; KINDS];
        for (kind, of) in Witness::sampled() {
            new[kind as usize] = self.count(kind as usize, of, samples);
        }
        self.left_out += u64::from(header.samples_left_out);
        self.scans.push_back((end_ns, new));
        if self.scans.len() > SCANS {
            self.scans.pop_front();
        }
    }

    /// Counts the samples of a kind that no scan before had.
    fn count(&mut self, kind: usize, of: SampleKind, samples: &[Sample]) -> u64 {
        let newest_ns = self.newest_ns[kind];
        let mut of_kind = samples.iter().filter(|sample| sample.is(of));
        let is_new = |sample: &&Sample| newest_ns.is_none_or(|ns| sample.stamp_ns > ns);
        let new = of_kind.clone().filter(is_new).count() as u64;
        let last_ns = of_kind.next_back().map(|sample| sample.stamp_ns);
        self.newest_ns[kind] = newest_ns.max(last_ns);
        self.counts[kind] += new;
        new
    }

    pub fn health(&self) -> SampleHealth {
        SampleHealth {
            counts: self.counts,
            left_out: self.left_out,
            rates_hz: std::array::from_fn(|kind| self.rate_hz(kind)),
        }
    }

    /// Samples that came with all scans but the first, over the time between their ends.
    fn rate_hz(&self, kind: usize) -> Option<f64> {
        let ((first_ns, _), (last_ns, _)) = (self.scans.front()?, self.scans.back()?);
        let samples: u64 = self.scans.iter().skip(1).map(|(_, new)| new[kind]).sum();
        let is_there = self.counts[kind] > 0 && last_ns > first_ns;
        is_there.then(|| samples as f64 / ((last_ns - first_ns) as f64 * 1e-9))
    }
}

impl SampleHealth {
    /// Returns it in words, as `gyro 208 Hz, wheels 50 Hz, 3 samples left out`; `None` without
    /// samples.
    pub fn in_words(&self) -> Option<String> {
        let rates = Witness::sampled().filter_map(|(kind, _)| {
            let hz = self.rates_hz[kind as usize]?;
            Some(format!("{} {hz:.0} Hz", kind.row().word))
        });
        let left_out = self.left_out;
        let left_out = (left_out > 0).then(|| format!("{left_out} samples left out"));
        let words: Vec<String> = rates.chain(left_out).collect();
        (!words.is_empty()).then(|| words.join(", "))
    }
}

#[cfg(test)]
mod tests {
    use bytemuck::Zeroable;

    use super::*;
    use crate::ByteBlock;

    const MS: i64 = 1_000_000;

    /// Adds the scan of a sweep of 250 ms with the samples of two sweeps, as a source does, of a
    /// gyro of 100 Hz until `out_ms`, and of wheels of 20 Hz.
    fn add(rates: &mut SampleRates, scan: i64, out_ms: i64) {
        let (start, end) = (250 * scan, 250 * scan + 249);
        let at = |every: i64| {
            (start - 249..=end)
                .filter(move |ms| ms % every == 0)
                .map(|ms| ms * MS)
        };
        let turns = at(10).filter(|ns| *ns < out_ms * MS);
        let turns = turns.map(|ns| Sample::yaw_rate(ns, 0.1));
        let speeds = at(50).map(|ns| Sample::speed(ns, 9.0));
        let mut samples: Vec<Sample> = turns.chain(speeds).collect();
        samples.sort_by_key(Sample::order);
        let mut header = ScanHeader {
            azimuths: 2,
            bins: 8,
            stride: 8,
            ..ScanHeader::default()
        };
        header.azimuth_stamp_ns[..2].copy_from_slice(&[start * MS, end * MS]);
        let mut blocks = [ByteBlock::zeroed(); 100];
        let bytes: &mut [u8] = bytemuck::cast_slice_mut(&mut blocks);
        header.set_samples(bytes, &samples, usize::from(scan == 3));
        rates.add(&header, bytes);
    }

    #[test]
    fn rates_are_those_of_the_stamps_and_fall_where_a_sensor_drops_out() {
        let mut rates = SampleRates::default();
        assert_eq!(rates.health(), SampleHealth::default());
        assert_eq!(rates.health().in_words(), None);
        for scan in 1..=40 {
            add(&mut rates, scan, i64::MAX / MS);
            // A source that is restarted sends a scan again.
            add(&mut rates, scan, i64::MAX / MS);
        }
        let health = rates.health();
        assert_eq!(health.rates_hz[..2], [Some(100.0), Some(20.0)]);
        let words = "gyro 100 Hz, wheels 20 Hz, 1 samples left out";
        assert_eq!(health.in_words().as_deref(), Some(words));
        for scan in 41..=100 {
            add(&mut rates, scan, 10_250);
        }
        let health = rates.health();
        assert_eq!(health.rates_hz[..2], [Some(0.0), Some(20.0)]);
        // From 1 ms to 10.249 s, and to 25.249 s.
        assert_eq!(health.counts[..2], [1024, 504]);
        let json = serde_json::to_value(health).unwrap_or_default();
        for (key, expected) in [
            ("gyro", 1024.0),
            ("wheels", 504.0),
            ("left_out", health.left_out as f64),
            ("gyro_hz", 0.0),
            ("wheels_hz", 20.0),
        ] {
            assert_eq!(json[key].as_f64(), Some(expected), "{key}: {json}");
        }
    }
}
