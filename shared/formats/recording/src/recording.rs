//! A recording, opened: where each message is, and the messages.

use std::{
    collections::{BTreeMap, BTreeSet},
    path::{Path, PathBuf},
};

use foxglove::{Decode, messages::RawImage};
use gyre_contract::{GivenAnew, Item, NumberedBy, topic};
use mcap::records::op;

use crate::{
    Entry, Head, RecordingError, exact_channel,
    file::{Channel, McapFile, Message, Span},
    generations::{self, Generations},
    head::NO_HEAD,
    image::{Rows, read},
    table::Table,
    view::image_channel,
};

/// Parts that are not there which are named.
const MAX_ABSENT: usize = 8;
/// Chunks that are kept in memory: messages of one scan can be in two.
const KEPT: usize = 2;

/// The bytes of a wire message: of its header, and of its payload that the header describes.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Stored {
    pub header: Vec<u8>,
    pub payload: Vec<u8>,
}

/// An open recording: at least one part.
#[derive(Default)]
pub struct Recording {
    parts: Vec<Part>,
    /// The messages of each topic by their sequence number.
    places: BTreeMap<String, BTreeMap<u64, Place>>,
    generations: BTreeMap<NumberedBy, Generations>,
    /// Files of other recordings.
    left_out: Vec<PathBuf>,
    /// The messages of some chunks, and the parts that they are in.
    kept: Vec<(usize, Span, Vec<Message>)>,
}

struct Part {
    head: Head,
    file: McapFile,
    missed: BTreeMap<String, u64>,
    /// The generations of a topic without a recorded message.
    skipped: Vec<(String, GivenAnew)>,
}

#[derive(Clone, Copy, Debug)]
struct Place {
    entry: Entry,
    part: usize,
    chunk: Span,
}

/// The messages of a part by topic, and the chunk that they are in.
type Places = Vec<(String, Vec<Entry>, Span)>;

impl Recording {
    /// Opens the files of a recording, at least one, in order. Files of a different recording than
    /// the first are left out.
    pub fn open(paths: &[PathBuf]) -> Result<Self, RecordingError> {
        let mut recording = Self::default();
        for path in paths {
            let (part, places) = Part::open(path)?;
            let mut parts = recording.parts.iter();
            match parts.all(|other| other.head.id == part.head.id) {
                true => recording.add(part, places),
                false => recording.left_out.push(path.clone()),
            }
        }
        Ok(recording)
    }

    /// Adds a part. Two messages with the same number are equal, unless the number was reassigned:
    /// the first message of a generation makes earlier ones void.
    fn add(&mut self, added: Part, places: Places) {
        let part = self.parts.len();
        for (topic, skipped) in &added.skipped {
            self.note(NumberedBy::of(topic), *skipped);
        }
        self.parts.push(added);
        for (topic, entries, chunk) in places {
            let by = NumberedBy::of(&topic);
            for entry in &entries {
                self.note(by, entry.given_anew());
            }
            let generations = self.generations.entry(by).or_default();
            let places = self.places.entry(topic).or_default();
            for entry in entries.into_iter().filter(|it| !generations.makes_void(it)) {
                let place = Place { entry, part, chunk };
                places.entry(entry.seq).or_insert(place);
            }
        }
    }

    /// Notes a generation, and removes the messages that it makes void.
    fn note(&mut self, by: NumberedBy, given: GivenAnew) {
        let generations = self.generations.entry(by).or_default();
        if !generations.note(given) {
            return;
        }
        let topics = self.places.iter_mut();
        for (_, places) in topics.filter(|(name, _)| NumberedBy::of(name) == by) {
            let mut given_anew = places.split_off(&given.first);
            given_anew.retain(|_, place| !generations.makes_void(&place.entry));
            places.extend(given_anew);
        }
    }

    pub fn head(&self) -> &Head {
        &self.parts[0].head
    }

    pub fn paths(&self) -> impl Iterator<Item = &Path> {
        self.parts.iter().map(|part| part.file.path.as_path())
    }

    pub fn entries(&self, topic: &str) -> impl Iterator<Item = Entry> + '_ {
        let places = self.places.get(topic).into_iter().flatten();
        places.map(|(_, place)| place.entry)
    }

    /// Returns the file that holds a message; the first one if none does.
    pub fn path_of(&self, topic: &str, seq: u64) -> &Path {
        let part = self.place(topic, seq).map_or(0, |place| place.part);
        &self.parts[part].file.path
    }

    /// Returns the numbers of messages that the recorders have counted as missed, by topic. One
    /// that is in another part counts all the same.
    pub fn missed(&self) -> BTreeMap<&str, u64> {
        let mut missed = BTreeMap::new();
        for (topic, count) in self.parts.iter().flat_map(|part| &part.missed) {
            *missed.entry(topic.as_str()).or_default() += count;
        }
        missed
    }

    pub fn left_out(&self) -> &[PathBuf] {
        &self.left_out
    }

    /// Returns the numbers of the parts that are not there, as far as later ones are.
    pub fn absent_parts(&self) -> Vec<usize> {
        let there: BTreeSet<usize> = self.parts.iter().map(|part| part.head.part).collect();
        let last = there.last().copied().unwrap_or_default();
        // A damaged head may have any number.
        let absent = (1..last).filter(|number| !there.contains(number));
        absent.take(MAX_ABSENT).collect()
    }

    /// Returns a sentence for each file that is damaged or has no end.
    pub fn damages(&self) -> impl Iterator<Item = String> {
        self.parts.iter().filter_map(|part| part.file.damage(true))
    }

    /// Returns the first of these sentences after which messages may be missing: the next recorder
    /// of a run repeats the messages that one which was killed had not written.
    pub fn damage(&self) -> Option<String> {
        let last = self.parts.len() - 1;
        let mut parts = self.parts.iter().enumerate();
        parts.find_map(|(number, part)| part.file.damage(number == last))
    }

    fn place(&self, topic: &str, seq: u64) -> Option<Place> {
        self.places.get(topic)?.get(&seq).copied()
    }

    pub fn read(&mut self, topic: &str, seq: u64) -> Result<Stored, RecordingError> {
        let Some(place) = self.place(topic, seq) else {
            let path = self.parts[0].file.path.display();
            return Err(RecordingError::Other(format!(
                "{path} has no message {seq} of topic `{topic}`: the recorder missed it, or the topic was not among its --topics"
            )));
        };
        let kept = self.keep(place)?;
        let ((_, _, messages), file) = (&self.kept[kept], &self.parts[place.part].file);
        stored(messages, &file.channels, topic, &place.entry).ok_or_else(|| {
            let reason = format!(
                "it has no complete message {seq} of topic `{topic}`, which its table lists"
            );
            RecordingError::damaged(&file.path, place.chunk.offset, reason)
        })
    }

    pub fn read_header<H: bytemuck::AnyBitPattern>(
        &mut self,
        topic: &str,
        seq: u64,
    ) -> Result<H, RecordingError> {
        let stored = self.read(topic, seq)?;
        read(&stored.header).ok_or_else(|| {
            let reason = format!("its messages of topic `{topic}` are of another version");
            RecordingError::foreign(self.path_of(topic, seq), reason)
        })
    }

    /// Returns the position of a chunk among those in memory, and reads it first if it is not
    /// there.
    fn keep(&mut self, place: Place) -> Result<usize, RecordingError> {
        let mut kept = self.kept.iter();
        let wanted = (place.part, place.chunk);
        if let Some(index) = kept.position(|(part, chunk, _)| (*part, *chunk) == wanted) {
            return Ok(index);
        }
        if self.kept.len() == KEPT {
            self.kept.remove(0);
        }
        let file = &mut self.parts[place.part].file;
        let messages = file.read(place.chunk, |_| true)?;
        self.kept.push((place.part, place.chunk, messages));
        Ok(self.kept.len() - 1)
    }
}

impl Part {
    fn open(path: &Path) -> Result<(Self, Places), RecordingError> {
        let mut part = Self {
            head: Head::default(),
            file: McapFile::open(path)?,
            missed: BTreeMap::new(),
            skipped: Vec::new(),
        };
        let (mut head, mut places, mut chunk) = (None, Vec::new(), None);
        let mut is_first = true;
        while let Some((opcode, span)) = part.file.next_record()? {
            let is_chunk = opcode == op::CHUNK;
            // The first chunk has the channels, and behind the end they are again, for a file whose
            // first chunk is damaged.
            if matches!(opcode, op::SCHEMA | op::CHANNEL) || (is_chunk && is_first) {
                part.learn_channels(span)?;
            }
            if is_chunk {
                (is_first, chunk) = (false, Some(span));
            }
            let Some(record) = part.file.metadata(opcode, span)? else {
                continue;
            };
            if let Some(read) = Head::of_metadata(&record) {
                head = Some(read.map_err(|reason| RecordingError::foreign(path, reason))?);
            } else if let Some(skipped) = generations::of_metadata(&record) {
                part.skipped.push(skipped);
            } else if let Some(table) = Table::of_metadata(&record) {
                part.missed = table.missed;
                // Of a chunk that was not found its messages are known all the same.
                let chunk = chunk.take().unwrap_or(Span { bytes: 0, ..span });
                let topics = table.entries.into_iter();
                places.extend(topics.map(|(topic, entries)| (topic, entries, chunk)));
            } else if Table::is_of(&record) {
                part.file.damage.insert(span.offset);
            }
        }
        part.head = head.ok_or_else(|| match part.file.damage.first() {
            None => RecordingError::foreign(path, NO_HEAD),
            Some(offset) => RecordingError::damaged(path, *offset, NO_HEAD),
        })?;
        Ok((part, places))
    }

    /// Learns the channels in a place, unless it is damaged.
    fn learn_channels(&mut self, span: Span) -> Result<(), RecordingError> {
        match self.file.read(span, |_| false) {
            Err(RecordingError::Damaged(_)) => Ok(()),
            read => read.map(drop),
        }
    }
}

fn stored(
    messages: &[Message],
    channels: &BTreeMap<u16, Channel>,
    name: &str,
    entry: &Entry,
) -> Option<Stored> {
    let on = |message: &Message, channel: &str| {
        let of = channels.get(&message.channel);
        of.is_some_and(|it| it.topic == channel) && message.sequence == entry.seq as u32
    };
    let (exact, bytes) = (exact_channel(name), topic(name)?.header.bytes);
    // A reassigned number may occur twice in a chunk.
    let is_it = |message: &Message| {
        let item = message.data.get(..size_of::<Item>()).and_then(read::<Item>);
        let is_it = |item: Item| (item.seq, item.generation) == (entry.seq, entry.generation);
        on(message, &exact) && item.is_some_and(is_it)
    };
    let index = messages.iter().position(is_it)?;
    let (header, rest) = messages[index].data.split_at_checked(bytes)?;
    let payload = match (image_channel(name), Rows::of(name, header)) {
        (Some(channel), Some(rows)) => {
            let image = messages[..index]
                .last()
                .filter(|message| on(message, channel))?;
            let image = RawImage::decode(image.data.as_slice()).ok()?;
            rows.join(&image.data, rest)?
        }
        _ => rest.to_vec(),
    };
    Some(Stored {
        header: header.to_vec(),
        payload,
    })
}
