//! The files of a bag as one, and the description of its radar.

use std::{
    collections::BTreeMap,
    path::{Path, PathBuf},
};

use gyre_datasets::DatasetOptions;
use gyre_ros2_messages::radar::DescribedRadar;
use mcap::records::op;

use crate::{
    bags::{
        Channel, McapFile, Message, RecordingError,
        files::{Files, compressed},
        radar::{ENCODER_COUNTS, Survey},
        topics::{Kind, Topics, described},
    },
    file::{Span, Times, joined},
};

type OwnDescription = Result<DescribedRadar, String>;

pub(crate) struct Bag {
    path: PathBuf,
    pub files: Vec<McapFile>,
    /// In the order of their first messages.
    spans: Vec<Placed>,
}

struct Placed {
    file: usize,
    span: Span,
    /// The times between which its messages are placed, ns.
    from_ns: i64,
    until_ns: i64,
}

/// A chunk with messages, or records that are read together.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct TimedSpan {
    span: Span,
    /// The receive times of its first and last message.
    times_ns: Times,
}

/// The place of a message in the order of time, and then of the files.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct Key {
    /// When the message was received, ns.
    ns: i64,
    pub span: u32,
    /// The number in the span, among those that are wanted.
    number: u32,
}

/// Messages are sorted within a window of so many spans. Chunks have about 1 MB.
const WINDOW: usize = 64;
/// Records outside of chunks form a span of their own from this size on, bytes.
const PLAIN_BYTES: u64 = 4 << 20;
/// Files of one recorder overlap by no more than this, ns: messages are a little out of order where
/// one file ends.
const OVERLAP_NS: u64 = 1_000_000_000;
/// The start of what zstd has compressed. No message in CDR begins so.
const ZSTD: [u8; 4] = [0x28, 0xb5, 0x2f, 0xfd];

type Timed = (McapFile, Vec<TimedSpan>, Times);

impl Bag {
    /// Opens the files, and learns all channels. Without a description they are in the order of
    /// their first messages: names do not give it, since tools number parts in several ways, and a
    /// folder may have several bags.
    pub fn open(path: &Path, files: &Files) -> Result<Self, RecordingError> {
        let timed = files.paths.iter().map(|path| timed(path));
        let mut timed = timed.collect::<Result<Vec<Timed>, _>>()?;
        if !files.are_in_order {
            timed.sort_by_key(|(.., times_ns)| *times_ns);
            for pair in timed.windows(2) {
                require_order(path, &pair[0], &pair[1])?;
            }
        }
        let mut bag = Self {
            path: path.to_owned(),
            files: Vec::new(),
            spans: Vec::new(),
        };
        let mut all = Vec::new();
        for (number, (file, spans, _)) in timed.into_iter().enumerate() {
            bag.files.push(file);
            all.extend(spans.into_iter().map(|span| (number, span)));
        }
        let ns = |time: u64| i64::try_from(time).unwrap_or(i64::MAX);
        all.sort_by_key(|(_, span)| span.times_ns.map(|(first, _)| first));
        let placed = |(number, (file, timed)): (usize, &(usize, TimedSpan))| {
            // A message that is later than the window reaches is placed at its end.
            let beyond = all.get(number + WINDOW).and_then(|it| it.1.times_ns);
            let from_ns = timed.times_ns.map_or(0, |(first, _)| ns(first));
            Placed {
                file: *file,
                span: timed.span,
                from_ns,
                until_ns: beyond.map_or(i64::MAX, |(first, _)| ns(first).max(from_ns)),
            }
        };
        bag.spans = all.iter().enumerate().map(placed).collect();
        Ok(bag)
    }

    pub fn file_of(&self, span: u32) -> Option<&McapFile> {
        self.files.get(self.spans.get(span as usize)?.file)
    }

    /// Returns the messages of a span that are wanted.
    ///
    /// A damaged span is not an error: it counts as damage of its file.
    pub fn read(
        &mut self,
        span: u32,
        wanted: impl Fn(&Channel) -> bool,
    ) -> Result<Vec<(Key, Message)>, RecordingError> {
        let Some(placed) = self.spans.get(span as usize) else {
            return Ok(Vec::new());
        };
        let messages = match self.files[placed.file].read(placed.span, wanted) {
            Err(RecordingError::Damaged(_)) => Vec::new(),
            read => read?,
        };
        if messages.iter().any(|it| it.data.starts_with(&ZSTD)) {
            return Err(compressed(&self.files[placed.file].path));
        }
        let key = |(number, message): (u32, Message)| {
            let ns = message.log_ns.clamp(placed.from_ns, placed.until_ns);
            (Key { ns, span, number }, message)
        };
        Ok((0..).zip(messages).map(key).collect())
    }

    /// Calls `each` with the wanted messages in the order of reception, until it returns false.
    pub fn read_in_order(
        &mut self,
        wanted: impl Fn(&Channel) -> bool,
        mut each: impl FnMut(&Self, Key, &Message) -> bool,
    ) -> Result<(), RecordingError> {
        let mut waiting = BTreeMap::new();
        for span in 0..=self.spans.len() as u32 {
            let placed = self.spans.get(span as usize);
            let next = Key {
                ns: placed.map_or(i64::MAX, |it| it.from_ns),
                span,
                number: 0,
            };
            while let Some(first) = waiting.first_entry().filter(|it| *it.key() < next) {
                let (key, message) = first.remove_entry();
                if !each(self, key, &message) {
                    return Ok(());
                }
            }
            waiting.extend(self.read(span, &wanted)?);
        }
        Ok(())
    }

    pub fn channels(&self) -> Vec<&Channel> {
        let files = self.files.iter();
        files.flat_map(|file| file.channels.values()).collect()
    }

    /// Describes the radar by its first configuration, or else by its azimuths and the options.
    /// Also returns where the description is from, to follow the topic in a sentence.
    pub fn describe(
        &mut self,
        topics: &Topics,
        options: &DatasetOptions,
    ) -> Result<(DescribedRadar, String), RecordingError> {
        let (survey, own) = self.survey(topics)?;
        let (said, refused) = match own {
            Some(Ok(own)) => (Some(own), None),
            Some(Err(reason)) => (None, Some(reason)),
            None => (None, None),
        };
        let usual = said.map_or(ENCODER_COUNTS, |own| own.radar.encoder_size);
        let shown = survey.other_counts(usual, said.is_some());
        let size = options.encoder_counts.or(shown).unwrap_or(usual);
        let counts = match (options.encoder_counts, shown) {
            (Some(_), _) => " as configured".to_owned(),
            (None, Some(_)) => format!(
                ", not {usual}: with these the step from the last azimuth to the first is as the others"
            ),
            (None, None) if said.is_some() => " as it says too".to_owned(),
            (None, None) => " as most radars have".to_owned(),
        };
        let resolution_m = options.range_resolution_m;
        let (mut described, before, after) = match (said, refused) {
            (Some(own), _) => (own, ", ".to_owned(), "as the radar says of itself"),
            (None, Some(reason)) if resolution_m.is_none() => {
                let reason = format!(
                    "has a configuration of its radar that cannot be used ({reason}): give the depth of a range bin with \
                     dataset.range_resolution_m"
                );
                return Err(RecordingError::unreadable(&self.path, reason));
            }
            (None, refused) => {
                let before = match refused {
                    Some(reason) => {
                        format!("; what the radar says of itself cannot be used ({reason}): ")
                    }
                    None => "; the radar does not describe itself in the bag: ".to_owned(),
                };
                let described = survey.describe(&self.path, resolution_m, size)?;
                (described, before, "are as found")
            }
        };
        let radar = &mut described.radar;
        radar.encoder_size = size;
        let (azimuths, bins) = (radar.azimuth_samples, radar.range_in_bins);
        let found = format!("{azimuths} azimuths of {bins} bins {after}");
        let note = format!("{before}{found}, {size} encoder counts per turn{counts}");
        Ok((described, note))
    }

    /// Looks at the first messages with scans, and for the first configuration that can be used, or
    /// why the first one cannot.
    fn survey(
        &mut self,
        topics: &Topics,
    ) -> Result<(Survey, Option<OwnDescription>), RecordingError> {
        let (mut survey, mut own) = (Survey::new(topics.scans.kind), None);
        self.read_in_order(
            |channel| topics.has(channel),
            |bag, key, message| {
                match (bag.configuration(key.span, topics, message), &own) {
                    (Some(Ok(described)), None | Some(Err(_))) => own = Some(Ok(described)),
                    (Some(Err(reason)), None) => own = Some(Err(reason)),
                    (None, _) if !survey.is_done() => survey.add(message),
                    _ => {}
                }
                let is_known = topics.configuration.is_none() || matches!(own, Some(Ok(_)));
                !(survey.is_done() && is_known)
            },
        )?;
        Ok((survey, own))
    }

    /// Returns the configuration of the radar in a message of that topic, or why it is unusable.
    fn configuration(
        &self,
        span: u32,
        topics: &Topics,
        message: &Message,
    ) -> Option<OwnDescription> {
        let topic = topics.configuration.as_ref()?;
        let channel = self.file_of(span)?.channels.get(&message.channel)?;
        let Kind::Configuration(form) = topic.kind else {
            return None;
        };
        (channel.topic == topic.name).then(|| {
            let described = described(form, message)?;
            let checked = described.radar.check();
            checked.map(|()| described).map_err(|e| e.to_string())
        })
    }
}

/// Finds the spans of a file with messages, and learns its channels from the summary at its end.
fn spans(file: &mut McapFile) -> Result<Vec<TimedSpan>, RecordingError> {
    let mut found = Vec::new();
    // Records outside of chunks.
    let mut plain: Option<TimedSpan> = None;
    while let Some((opcode, span)) = file.next_record()? {
        let times_ns = file.times_ns(opcode, span)?;
        match opcode {
            op::SCHEMA | op::CHANNEL if file.is_complete => {
                file.read(span, |_| false)?;
            }
            op::SCHEMA | op::CHANNEL | op::MESSAGE => {
                // A damaged place parts them.
                let ends_there = |plain: &mut TimedSpan| plain.span.end() != span.offset;
                found.extend(plain.take_if(ends_there));
                let plain = plain.get_or_insert(TimedSpan {
                    span: Span { bytes: 0, ..span },
                    times_ns,
                });
                plain.span.bytes += span.bytes;
                plain.times_ns = joined(plain.times_ns, times_ns);
            }
            _ => found.extend(plain.take()),
        }
        let is_long = |plain: &mut TimedSpan| plain.span.bytes >= PLAIN_BYTES;
        found.extend(plain.take_if(is_long));
        if opcode == op::CHUNK {
            found.push(TimedSpan { span, times_ns });
        }
    }
    found.extend(plain);
    Ok(found)
}

/// Opens a file, finds its spans, and learns its channels: a file without a list of them, or with
/// damage, which may hide one, is read as a whole.
fn timed(path: &Path) -> Result<Timed, RecordingError> {
    let mut file = McapFile::open(path)?;
    let spans = spans(&mut file)?;
    if file.channels.is_empty() || !file.damage.is_empty() {
        for span in &spans {
            // Damaged spans have no channels.
            let _ = file.read(span.span, |_| false);
        }
    }
    let times = spans.iter().map(|span| span.times_ns).fold(None, joined);
    Ok((file, spans, times))
}

fn require_order(folder: &Path, earlier: &Timed, later: &Timed) -> Result<(), RecordingError> {
    let (Some((_, end)), Some((begin, _))) = (earlier.2, later.2) else {
        return Ok(());
    };
    if begin.saturating_add(OVERLAP_NS) >= end {
        return Ok(());
    }
    let name = |(file, ..): &Timed| file.path.file_name().unwrap_or_default().to_owned();
    let overlap_s = (end - begin) as f64 * 1e-9;
    let reason = format!(
        "has files of the same time: {} begins {overlap_s:.1} s before {} ends, so that they are of several bags; give each a folder of \
         its own, or name one file",
        name(later).display(),
        name(earlier).display()
    );
    Err(RecordingError::unreadable(folder, reason))
}
