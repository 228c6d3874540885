//! The scans of a bag as a dataset.

mod index;

use std::{
    collections::BTreeMap,
    ops::RangeInclusive,
    path::{Path, PathBuf},
};

use gyre_colossus::{Azimuth, SweepAssembler};
use gyre_datasets::{
    AzimuthSource, DEFAULT_TURN_NS, Dataset, DatasetOptions, Format, ImageSize, OpenError,
    Properties, ReadError, turn_ns,
};
use gyre_geometry::{
    ScanSlot, SweepGeometry,
    samples::{Logged, SampleKind},
};
use gyre_ros2_messages::radar::DescribedRadar;
use index::{Entry, Index};

use crate::bags::{
    Message, RecordingError,
    bag::{Bag, Key},
    files::{Files, files},
    sensors,
    topics::{Topics, azimuths},
};

pub fn open(path: &Path, options: &DatasetOptions) -> Result<Box<dyn Dataset>, OpenError> {
    options.check()?;
    open_files(path, &files(path)?, options)
}

/// Opens the scans in a bag again, with the files that it had.
pub fn reopen(
    path: &Path,
    options: &DatasetOptions,
    files: Vec<PathBuf>,
) -> Result<Box<dyn Dataset>, OpenError> {
    options.check()?;
    let files = Files {
        paths: files,
        are_in_order: true,
    };
    open_files(path, &files, options)
}

fn open_files(
    path: &Path,
    files: &Files,
    options: &DatasetOptions,
) -> Result<Box<dyn Dataset>, OpenError> {
    if options.azimuth_source == Some(AzimuthSource::Uniform) {
        let (format, key) = (Some(Format::Ros2Bag), "azimuth_source");
        let reason = "its azimuths are those of the encoder; leave the key out";
        return Err(OpenError::option(format, key, "uniform", reason));
    }
    Ok(Box::new(Scans::open(path, files, options)?))
}

const MEANING: &str = "Logged stamps are times at which the bag received the end of a turn; each azimuth has the radar's own time, and the time of a scan \
                       is the middle of its first and last.";

struct Scans {
    path: PathBuf,
    properties: Properties,
    bag: Bag,
    topics: Topics,
    described: DescribedRadar,
    options: DatasetOptions,
    index: Index,
    files: Vec<PathBuf>,
    /// The spans that were read last, and their messages of scans.
    kept: (Option<RangeInclusive<u32>>, BTreeMap<Key, Message>),
}

impl Scans {
    fn open(path: &Path, files: &Files, options: &DatasetOptions) -> Result<Self, RecordingError> {
        let mut bag = Bag::open(path, files)?;
        let wished = options.topic.as_ref().map(|topic| topic.as_str());
        let topics = Topics::choose(path, &bag.channels(), wished)?;
        let (described, source) = bag.describe(&topics, options)?;
        let assembler = SweepAssembler::new(&described.radar, *options).map_err(|error| {
            RecordingError::unreadable(path, format_args!("cannot be read: {error}"))
        })?;
        let index = Index::of(&mut bag, &topics, &described, assembler)?;
        if let Some(reason) = index.why_none_can_be_read(&topics.scans.name) {
            return Err(RecordingError::unreadable(path, reason));
        }
        let stamps = index.entries.iter().map(|entry| entry.stamp_ns);
        let damages = bag.files.iter().filter_map(|file| file.damage(true));
        let damages: Vec<String> = damages.collect();
        let mut notes = vec![format!("Scans are on {}{source}.", topics.scans.name)];
        notes.extend(index.notes());
        notes.extend(damages.iter().map(|sentence| format!("{sentence}.")));
        let size = ImageSize {
            width: usize::from(described.radar.range_in_bins),
            height: usize::from(described.radar.azimuth_samples),
        };
        Ok(Self {
            properties: Properties {
                limits: index.limits,
                period_ns: turn_ns(stamps).unwrap_or(DEFAULT_TURN_NS),
                encoder_counts: Some(described.radar.encoder_size),
                notes,
                damage: damages.into_iter().next(),
                ..Properties::of(Format::Ros2Bag, index.entries.len(), size, MEANING)
            },
            files: bag.files.iter().map(|file| file.path.clone()).collect(),
            path: path.to_owned(),
            bag,
            topics,
            described,
            options: *options,
            index,
            kept: (None, BTreeMap::new()),
        })
    }

    /// Reads the messages of scans of some spans, unless they are there.
    fn keep(&mut self, spans: &RangeInclusive<u32>) -> Result<(), RecordingError> {
        let topic = &self.topics.scans.name;
        let (there, messages) = (self.kept.0.take(), &mut self.kept.1);
        messages.retain(|key, _| spans.contains(&key.span));
        let is_there = |span: &u32| there.as_ref().is_some_and(|there| there.contains(span));
        for span in spans.clone().filter(|span| !is_there(span)) {
            messages.extend(self.bag.read(span, |channel| channel.topic == *topic)?);
        }
        self.kept.0 = Some(spans.clone());
        Ok(())
    }

    fn assemble(
        &mut self,
        index: usize,
        entry: &Entry,
        mut slot: ScanSlot<'_>,
    ) -> Result<Option<SweepGeometry>, RecordingError> {
        let assembler = SweepAssembler::new(&self.described.radar, self.options);
        let Ok(mut assembler) = assembler else {
            return Ok(None);
        };
        self.keep(&entry.spans)?;
        let (mut clock, mut found) = (self.index.clock(index), None);
        for (key, message) in self.kept.1.range(entry.start.message..) {
            if self.index.repeated.contains(key) {
                continue;
            }
            let mut skipped = match *key == entry.start.message {
                true => entry.start.row,
                false => 0,
            };
            let each = |azimuth: Azimuth<'_>, received_ns| {
                if skipped > 0 {
                    skipped -= 1;
                    return;
                }
                for (azimuth, stamp_ns) in clock.stamp(azimuth, received_ns) {
                    if found.is_none() {
                        found = assembler.add(&azimuth, stamp_ns, &mut slot);
                    }
                }
            };
            // A damaged one between was left out of the index, too.
            let _ = azimuths(self.topics.scans.kind, message, &self.described, each);
            if found.is_some() {
                break;
            }
        }
        Ok(found.map(|sweep| sweep.geometry))
    }
}

impl Dataset for Scans {
    fn properties(&self) -> &Properties {
        &self.properties
    }

    fn files(&self) -> &[PathBuf] {
        &self.files
    }

    fn file(&self, index: usize) -> &Path {
        let entry = self.index.entries.get(index);
        let file = entry.and_then(|entry| self.bag.file_of(entry.end.message.span));
        file.map_or(Path::new(""), |file| &file.path)
    }

    fn nominal_stamp_ns(&self, index: usize) -> Option<i64> {
        Some(self.index.entries.get(index)?.stamp_ns)
    }

    fn logged_stamp_ns(&self, index: usize) -> Option<i64> {
        Some(self.index.entries.get(index)?.logged_ns)
    }

    fn logged(&mut self, of: SampleKind, topic: Option<&str>) -> Result<Option<Logged>, OpenError> {
        Ok(sensors::samples(&mut self.bag, &self.path, of, topic)?)
    }

    fn read(&mut self, index: usize, slot: ScanSlot<'_>) -> Result<SweepGeometry, ReadError> {
        let len = self.len();
        let entry = self.index.entries.get(index).cloned();
        let entry = entry.ok_or(ReadError::NoSuchScan { index, len })?;
        let path = self.file(index).to_owned();
        let failed = |error: RecordingError| error.of_scan(&path);
        if let Some(reason) = &entry.damage {
            return Err(ReadError::Scan(format!(
                "the message of scan {index} in {} cannot be decoded: {reason}",
                path.display()
            )));
        }
        let assembled = self.assemble(index, &entry, slot).map_err(failed)?;
        assembled.ok_or_else(|| ReadError::Damaged {
            path: path.clone(),
            reason: format!("scan {index} is not as it was when the bag was opened"),
        })
    }
}
