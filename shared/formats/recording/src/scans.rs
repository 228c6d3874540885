//! The scans of a recording as a dataset: bytes, azimuths, times and constants as they were
//! recorded.

use std::{
    collections::BTreeMap,
    path::{Path, PathBuf},
};

use gyre_contract::{Message, Scan, ScanHeader};
use gyre_datasets::{
    DEFAULT_TURN_NS, Dataset, DatasetOptions, Format, ImageSize, OpenError, Properties, ReadError,
    turn_ns,
};
use gyre_geometry::{MAX_AZIMUTHS, ScanLimits, ScanSlot, SweepGeometry, samples::Sample};

use crate::{Entry, Recording, Stored, image::read};

/// Scans of a drive of months; a larger number in a table is damaged.
const MAX_SCANS: u64 = 50_000_000;

/// The scans of a recording. A scan has the number that it had in the recorded run.
pub(crate) struct Scans {
    recording: Recording,
    properties: Properties,
    files: Vec<PathBuf>,
    entries: BTreeMap<usize, Entry>,
    first: SweepGeometry,
    /// Of the scan that was read last.
    samples: Vec<Sample>,
}

impl Scans {
    pub fn open(mut recording: Recording) -> Result<Self, OpenError> {
        let entries: BTreeMap<usize, Entry> = recording
            .entries(Scan::TOPIC)
            .filter(|entry| entry.scan < MAX_SCANS)
            .map(|entry| (entry.scan as usize, entry))
            .collect();
        let path = recording.paths().next().unwrap_or(Path::new(""));
        let path = path.display().to_string();
        let Some(first) = entries.values().next() else {
            let reason = format!("{path} holds no scans: the topic `scan` was not recorded");
            return Err(OpenError::Recording(reason));
        };
        let stored = recording.read(Scan::TOPIC, first.seq);
        let stored = stored.map_err(|error| OpenError::Recording(error.to_string()))?;
        let (first, _) = geometry(&stored)
            .ok_or_else(|| OpenError::Recording(format!("the first scan of {path} is damaged")))?;
        let period_ns = turn_ns(entries.values().map(|entry| entry.stamp_ns));
        let len = entries.keys().next_back().map_or(0, |last| last + 1);
        let size = ImageSize {
            width: first.bins,
            height: first.azimuths,
        };
        let meaning = "as recorded: the middle of the sweep on the sensor's clock";
        Ok(Self {
            properties: Properties {
                limits: ScanLimits {
                    bytes: recording.head().scan_bytes,
                    azimuths: MAX_AZIMUTHS,
                },
                period_ns: period_ns.unwrap_or(DEFAULT_TURN_NS),
                notes: notes(&recording, &entries),
                damage: recording.damage(),
                ..Properties::of(Format::Mcap, len, size, meaning)
            },
            samples: Vec::new(),
            files: recording.paths().map(Path::to_owned).collect(),
            recording,
            entries,
            first,
        })
    }

    /// Rejects options other than those that the scans were recorded with, which are in their
    /// numbers.
    pub fn check(
        &self,
        options: &DatasetOptions,
        recorded: &DatasetOptions,
    ) -> Result<(), OpenError> {
        let scan = &self.first;
        let is = DatasetOptions {
            range_resolution_m: Some(scan.range_resolution_m),
            range_offset_m: Some(scan.range_offset_m),
            doppler_s: Some(scan.doppler_s),
            azimuth_eccentricity_rad: recorded.azimuth_eccentricity_rad.or(Some(0.0)),
            topic: None,
            ..*recorded
        };
        let reason = "its scans have the constants that they were recorded with; leave the key out";
        macro_rules! check {
            ($($key:ident)*) => {$(
                if let Some(value) = options.$key.filter(|value| Some(*value) != is.$key) {
                    let key = stringify!($key);
                    return Err(OpenError::option(Some(Format::Mcap), key, value, reason));
                }
            )*};
        }
        check!(range_resolution_m range_offset_m doppler_s azimuth_eccentricity_rad);
        check!(topic azimuth_source encoder_counts);
        Ok(())
    }
}

/// Returns notes on missing data in a recording: whole sentences.
fn notes(recording: &Recording, entries: &BTreeMap<usize, Entry>) -> Vec<String> {
    let damages = recording.damages();
    let mut notes: Vec<String> = damages.map(|it| format!("{it}.")).collect();
    notes.extend(recording.absent_parts().iter().map(|number| {
        format!("Part {number} of the recording is not there: what only it holds is missing.")
    }));
    notes.extend(recording.left_out().iter().map(|path| {
        let path = path.display();
        format!("{path} is of another recording, and is left out.")
    }));
    let (first, last) = (entries.keys().next(), entries.keys().next_back());
    if let (Some(first), Some(last)) = (first, last) {
        let lacking = last - first + 1 - entries.len();
        if lacking > 0 {
            notes.push(format!(
                "{lacking} of the scans {first} to {last} are not in it: the run could not read them, or the recorder missed them."
            ));
        }
    }
    if recording.head().mode == "live" {
        notes.push("The run was live: which scans it dropped depended on the load, and a replay of the scans drops none.".to_owned());
    }
    notes
}

/// Returns the geometry of a scan and its header; `None` if they do not fit the payload.
fn geometry(stored: &Stored) -> Option<(SweepGeometry, Box<ScanHeader>)> {
    let header: Box<ScanHeader> = Box::new(read(&stored.header)?);
    let geometry = header.view(&stored.payload)?.geometry;
    Some((geometry, header))
}

impl Dataset for Scans {
    fn properties(&self) -> &Properties {
        &self.properties
    }

    fn first(&self) -> usize {
        self.entries.keys().next().copied().unwrap_or_default()
    }

    fn files(&self) -> &[PathBuf] {
        &self.files
    }

    fn file(&self, index: usize) -> &Path {
        let seq = self.entries.get(&index).map_or(u64::MAX, |entry| entry.seq);
        self.recording.path_of(Scan::TOPIC, seq)
    }

    fn nominal_stamp_ns(&self, index: usize) -> Option<i64> {
        self.entries.get(&index).map(|entry| entry.stamp_ns)
    }

    fn read(&mut self, index: usize, slot: ScanSlot<'_>) -> Result<SweepGeometry, ReadError> {
        let len = self.len();
        if index >= len {
            return Err(ReadError::NoSuchScan { index, len });
        }
        let path = self.file(index).to_owned();
        let Some(entry) = self.entries.get(&index) else {
            return Err(ReadError::Scan(format!(
                "{} has no scan {index}: the run did not read it, or the recorder missed it",
                path.display()
            )));
        };
        let stored = self
            .recording
            .read(Scan::TOPIC, entry.seq)
            .map_err(|error| error.of_scan(&path))?;
        let damaged = || ReadError::Damaged {
            path: path.clone(),
            reason: format!("scan {index} does not fit its header and its table"),
        };
        let (geometry, header) = geometry(&stored).ok_or_else(damaged)?;
        let (scan, stamp_ns) = (header.item.scan, header.item.stamp_ns);
        if (scan, stamp_ns) != (entry.scan, entry.stamp_ns) {
            return Err(damaged());
        }
        let samples = header.read_samples(&stored.payload);
        self.samples = samples.ok_or_else(damaged)?;
        let powers = header
            .power_bytes()
            .and_then(|end| stored.payload.get(..end));
        let (powers, azimuths) = (powers.ok_or_else(damaged)?, geometry.azimuths);
        let bytes = powers.len();
        let limits = self.limits();
        if bytes > limits.bytes || azimuths > limits.azimuths {
            return Err(damaged());
        }
        slot.bytes[..bytes].copy_from_slice(powers);
        slot.azimuth_rad[..azimuths].copy_from_slice(&header.azimuth_rad[..azimuths]);
        slot.stamp_ns[..azimuths].copy_from_slice(&header.azimuth_stamp_ns[..azimuths]);
        slot.flags[..azimuths].copy_from_slice(&header.azimuth_flags[..azimuths]);
        Ok(geometry)
    }

    fn samples(&self) -> &[Sample] {
        &self.samples
    }
}
