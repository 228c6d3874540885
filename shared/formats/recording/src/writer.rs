//! Writes a recording: a chunk at least twice a second, each with its table behind it.

#[cfg(test)]
mod tests;

use std::{
    collections::{BTreeMap, VecDeque},
    fs::{File, OpenOptions},
    io::{self, Seek},
    mem,
    os::unix::fs::OpenOptionsExt,
    path::{Path, PathBuf},
    sync::Arc,
    time::{Duration, Instant},
};

use bytemuck::pod_read_unaligned;
use foxglove::{Encode, Schema, messages::RawImage};
use gyre_contract::{GivenAnew, Item, topic};
use mcap::{Compression, McapError, WriteOptions, Writer, records::MessageHeader};

use crate::{
    ENCODING, Entry, Head, LogLine, RecordingError, exact_channel, generations,
    image::Rows,
    table::Table,
    view::{Recent, View, image_channel, views},
};

/// The longest time for which a chunk is not synchronised. A power failure loses at most this much.
const SYNC_PERIOD: Duration = Duration::from_secs(1);
/// The longest time for which a message stays in memory. At four scans a second the history of the
/// topics covers twice as much, so that a recorder that is killed and started again misses none.
const FLUSH_PERIOD: Duration = Duration::from_millis(500);
/// A chunk of this size, uncompressed, is written.
const CHUNK_BYTES: usize = 4 << 20;
/// The fastest level with entropy coding: the noise in a scan has no repetitions, but few values.
const LEVEL: u32 = 1;

/// Log lines that wait for the first message: a radar may be switched on days after the recorder.
const MAX_EARLY: usize = 4096;

const PROTOBUF: &str = "protobuf";
/// The channel of the run's health, and its schema: any JSON object.
const HEALTH: &str = "/health";
const HEALTH_SCHEMA: &[u8] = br#"{"type":"object"}"#;

#[derive(Clone, Debug)]
pub struct Incoming {
    pub topic: &'static str,
    pub header: Vec<u8>,
    /// The bytes of the payload that the header describes.
    pub payload: Vec<u8>,
    /// When the recorder received it, ns since 1970.
    pub received_ns: i64,
    /// Messages of the topic that were missed directly before it.
    pub missed: u64,
    /// The numbers reassigned by earlier generations without a recorded message.
    pub skipped: Option<GivenAnew>,
}

type Synchronise = Arc<dyn Fn(&File) -> io::Result<()> + Send + Sync>;

pub struct RecordingWriter {
    pub path: PathBuf,
    /// `None` after a failure.
    mcap: Option<Writer<File>>,
    /// The file beside the one that the library writes to.
    file: File,
    synchronise: Synchronise,
    /// Length of the file up to the last complete table.
    complete_bytes: u64,
    /// When the oldest chunk that is not synchronised was written.
    unsynchronised: Option<Instant>,
    channels: BTreeMap<String, u16>,
    recent: Recent,
    table: Table,
    skipped: Vec<(&'static str, GivenAnew)>,
    /// Bytes of the messages since the last table, and when the first of them came.
    pending: (usize, Option<Instant>),
    /// The newest time of the sensor, which log lines are placed at.
    newest_ns: Option<i64>,
    /// The newest time of the sensor when this file had its first message, which may be of an
    /// earlier scan: topics lag behind `scan`.
    first_ns: Option<i64>,
    /// The newest log lines that came before the first message, and the number of older ones.
    early: VecDeque<LogLine>,
    left_out: u64,
}

/// Returns the header of a message: the sensor's time, and when it was received.
fn header(stamp_ns: i64, received_ns: i64, sequence: u32) -> MessageHeader {
    let positive = |ns: i64| u64::try_from(ns).unwrap_or_default();
    MessageHeader {
        channel_id: 0,
        sequence,
        log_time: positive(stamp_ns),
        publish_time: positive(received_ns),
    }
}

impl RecordingWriter {
    /// Begins a file, which must not exist.
    pub fn create(path: &Path, head: &Head) -> Result<Self, RecordingError> {
        Self::create_with(path, head, Arc::new(File::sync_data))
    }

    pub(crate) fn create_with(
        path: &Path,
        head: &Head,
        synchronise: Synchronise,
    ) -> Result<Self, RecordingError> {
        let failed = |error| RecordingError::io(path, error);
        let mut new = OpenOptions::new();
        new.write(true).create_new(true).mode(0o600);
        let file = new.open(path).map_err(failed)?;
        let own = file.try_clone().map_err(failed)?;
        let options = WriteOptions::new()
            .compression(Some(Compression::Zstd))
            .compression_level(LEVEL)
            .compression_threads(0)
            .library(concat!("gyre ", env!("CARGO_PKG_VERSION")))
            // Chunks end where a table is due. In memory until then: a killed recorder leaves no
            // half of one.
            .chunk_size(None)
            .disable_seeking(true);
        let unwritable = |source| RecordingError::of(path, source);
        let mut writer = Self {
            path: path.to_owned(),
            mcap: Some(options.create(file).map_err(unwritable)?),
            file: own,
            synchronise,
            complete_bytes: 0,
            unsynchronised: None,
            channels: BTreeMap::new(),
            recent: Recent::default(),
            table: Table::default(),
            skipped: Vec::new(),
            pending: (0, None),
            newest_ns: None,
            first_ns: None,
            early: VecDeque::new(),
            left_out: 0,
        };
        writer.begin(head).map_err(unwritable)?;
        // Its name survives a power failure too.
        let synchronised = path.parent().map_or(Ok(()), gyre_storage::sync_folder);
        synchronised.map_err(|error| failed(error.source))?;
        Ok(writer)
    }

    /// Writes the head and the channels that replay needs, so that readers find them in the first
    /// chunk.
    fn begin(&mut self, head: &Head) -> Result<(), McapError> {
        self.mcap()?.write_metadata(&head.to_metadata())?;
        for topic in head.topics.iter().filter_map(|name| topic(name)) {
            let schema = || {
                Some(Schema::new(
                    topic.header.name,
                    ENCODING,
                    topic.name.as_bytes(),
                ))
            };
            self.channel(&exact_channel(topic.name), ENCODING, schema)?;
            if let Some(name) = image_channel(topic.name) {
                self.channel(name, PROTOBUF, RawImage::get_schema)?;
            }
        }
        self.write_chunk()
    }

    /// Adds a message, and writes a chunk if one is due.
    ///
    /// After an error the file is cut back to its last complete chunk.
    pub fn add(&mut self, message: &Incoming) -> Result<(), RecordingError> {
        self.checked(|writer| writer.write_message(message))?;
        self.flush_if_due()
    }

    fn write_message(&mut self, message: &Incoming) -> Result<(), McapError> {
        let topic = message.topic;
        let Some(item) = message.header.get(..size_of::<Item>()) else {
            return Ok(());
        };
        let item: Item = pod_read_unaligned(item);
        let header = header(item.stamp_ns, message.received_ns, item.seq as u32);
        let rows = Rows::of(topic, &message.header);
        let parts = rows.and_then(|rows| Some((rows, rows.split(&message.payload)?)));
        let mut exact = message.header.clone();
        match (parts, image_channel(topic)) {
            (Some((rows, (image, rest))), Some(channel)) => {
                self.view(&View::image(channel, &rows, image, item.stamp_ns), header)?;
                exact.extend_from_slice(&rest);
            }
            _ => exact.extend_from_slice(&message.payload),
        }
        if let Some(channel) = self.channels.get(&exact_channel(topic)).copied() {
            self.write(channel, &exact, header)?;
        }
        let trajectory = self.recent.add(topic, &message.header);
        for view in views(topic, &message.header).iter().chain(&trajectory) {
            self.view(view, header)?;
        }
        let entries = self.table.entries.entry(topic.to_owned()).or_default();
        entries.push(Entry::of(&item));
        self.missed(topic, message.missed);
        self.skipped.extend(message.skipped.map(|it| (topic, it)));
        self.newest_ns = self.newest_ns.max(Some(item.stamp_ns));
        self.first_ns = self.first_ns.or(self.newest_ns);
        self.write_early()
    }

    /// Counts messages that were missed, without one after them.
    pub fn missed(&mut self, topic: &str, missed: u64) {
        if missed > 0 {
            *self.table.missed.entry(topic.to_owned()).or_default() += missed;
        }
    }

    /// Adds a line of the log at the time of the newest scan.
    pub fn add_log(&mut self, line: LogLine) -> Result<(), RecordingError> {
        if self.newest_ns.is_none() {
            if self.early.len() == MAX_EARLY {
                self.early.pop_front();
                self.left_out += 1;
            }
            self.early.push_back(line);
            return Ok(());
        }
        self.checked(|writer| writer.write_log(&line))
    }

    fn write_log(&mut self, line: &LogLine) -> Result<(), McapError> {
        let stamp_ns = self.newest_ns.unwrap_or(line.written_ns);
        self.view(&View::log(line), header(stamp_ns, line.written_ns, 0))
    }

    fn write_early(&mut self) -> Result<(), McapError> {
        let lines = mem::take(&mut self.early);
        let left_out = mem::take(&mut self.left_out);
        let note = lines.front().filter(|_| left_out > 0).map(|line| LogLine {
            written_ns: line.written_ns,
            level: "WARN".to_owned(),
            stage: "recorder".to_owned(),
            message: format!(
                "{left_out} lines before the first message are left out: log.jsonl of the run has them"
            ),
        });
        let mut lines = note.into_iter().chain(lines);
        lines.try_for_each(|line| self.write_log(&line))
    }

    /// Adds the health of the run, JSON, at the time of the newest scan; before the first one it is
    /// left out.
    pub fn add_health(&mut self, json: &str, now_ns: i64) -> Result<(), RecordingError> {
        let Some(stamp_ns) = self.newest_ns else {
            return Ok(());
        };
        let schema = || Some(Schema::new("gyre.Health", "jsonschema", HEALTH_SCHEMA));
        self.checked(|writer| {
            let channel = writer.channel(HEALTH, "json", schema)?;
            writer.write(channel, json.as_bytes(), header(stamp_ns, now_ns, 0))
        })
    }

    pub(crate) fn bytes(&self) -> u64 {
        self.complete_bytes
    }

    /// Returns the time from the newest scan when the file was begun to the newest one now, on the
    /// sensor's clock, ns.
    pub(crate) fn span_ns(&self) -> i64 {
        let newest_ns = self.newest_ns.zip(self.first_ns);
        newest_ns.map_or(0, |(newest, first)| newest.saturating_sub(first))
    }

    fn view(&mut self, view: &View, header: MessageHeader) -> Result<(), McapError> {
        let channel = self.channel(view.channel, PROTOBUF, view.schema)?;
        self.write(channel, &view.data, header)
    }

    /// Returns the channel of this name, which is added if it is not there.
    fn channel(
        &mut self,
        name: &str,
        encoding: &str,
        schema: impl FnOnce() -> Option<Schema>,
    ) -> Result<u16, McapError> {
        if let Some(channel) = self.channels.get(name) {
            return Ok(*channel);
        }
        let mcap = self.mcap()?;
        let schema = match schema() {
            Some(schema) => mcap.add_schema(&schema.name, &schema.encoding, &schema.data)?,
            None => 0,
        };
        let channel = mcap.add_channel(schema, name, encoding, &BTreeMap::new())?;
        self.channels.insert(name.to_owned(), channel);
        Ok(channel)
    }

    fn write(&mut self, channel_id: u16, data: &[u8], of: MessageHeader) -> Result<(), McapError> {
        let header = MessageHeader { channel_id, ..of };
        self.mcap()?.write_to_known_channel(&header, data)?;
        let (bytes, since) = self.pending;
        self.pending = (bytes + data.len(), since.or_else(|| Some(Instant::now())));
        Ok(())
    }

    /// Writes the messages so far as a chunk if they are many, or have waited for long, and
    /// synchronises the file once a second. Call it twice a second while there are no messages.
    pub fn flush_if_due(&mut self) -> Result<(), RecordingError> {
        let (bytes, since) = self.pending;
        let is_due =
            bytes >= CHUNK_BYTES || since.is_some_and(|since| since.elapsed() >= FLUSH_PERIOD);
        if is_due {
            self.flush()?;
        }
        match self.unsynchronised {
            Some(since) if since.elapsed() >= SYNC_PERIOD => self.checked(Self::synchronise),
            _ => Ok(()),
        }
    }

    /// Writes the messages so far as a chunk, and its table.
    pub fn flush(&mut self) -> Result<(), RecordingError> {
        self.checked(Self::write_chunk)
    }

    fn write_chunk(&mut self) -> Result<(), McapError> {
        self.mcap()?.flush()?;
        for (topic, skipped) in mem::take(&mut self.skipped) {
            let record = generations::to_metadata(topic, skipped);
            self.mcap()?.write_metadata(&record)?;
        }
        let table = self.table.to_metadata();
        self.mcap()?.write_metadata(&table)?;
        self.mcap()?.flush()?;
        self.table.entries.clear();
        self.pending = (0, None);
        // The file of the library and this one have one position.
        self.complete_bytes = self.file.stream_position()?;
        self.unsynchronised.get_or_insert_with(Instant::now);
        Ok(())
    }

    fn synchronise(&mut self) -> Result<(), McapError> {
        (self.synchronise)(&self.file)?;
        self.unsynchronised = None;
        Ok(())
    }

    /// Writes the remaining messages and the summary.
    pub fn finish(mut self) -> Result<(), RecordingError> {
        self.checked(Self::write_early)?;
        self.end()
    }

    /// Continues in the next part after this one has ended.
    pub(crate) fn go_on(&mut self, path: &Path, head: &Head) -> Result<(), RecordingError> {
        let next = Self::create_with(path, head, self.synchronise.clone())?;
        let before = mem::replace(self, next);
        // The state of viewers continues.
        (self.recent, self.newest_ns) = (before.recent, before.newest_ns);
        Ok(())
    }

    pub(crate) fn end(&mut self) -> Result<(), RecordingError> {
        self.flush()?;
        self.checked(|writer| {
            writer.mcap()?.finish()?;
            writer.synchronise()
        })
    }

    fn mcap(&mut self) -> Result<&mut Writer<File>, McapError> {
        self.mcap
            .as_mut()
            .ok_or(McapError::AttemptedWriteAfterFailure)
    }

    /// Writes, and after a failure cuts the file back to its last complete chunk.
    fn checked(
        &mut self,
        write: impl FnOnce(&mut Self) -> Result<(), McapError>,
    ) -> Result<(), RecordingError> {
        write(self).map_err(|source| {
            // Dropped as it is, it would write a summary.
            drop(self.mcap.take().map(Writer::into_inner));
            let _ = self.file.set_len(self.complete_bytes);
            RecordingError::of(&self.path, source)
        })
    }
}
