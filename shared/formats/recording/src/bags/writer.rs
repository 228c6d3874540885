//! Writes a bag.

use std::{
    collections::BTreeMap,
    fmt::{Display, Write as _},
    fs::{self, File},
    io::{self, BufWriter},
    marker::PhantomData,
    path::{Path, PathBuf},
};

use gyre_ros2_messages::{Ros2Message, encode};
use gyre_storage::lock::{Attempt, try_lock, try_lock_existing};
use mcap::{Compression, McapError, WriteOptions, Writer, records::MessageHeader};

use crate::bags::{
    RecordingError,
    files::{METADATA, PROFILE},
};

/// The size of a chunk, uncompressed, bytes: a few scans.
const CHUNK_BYTES: u64 = 4 << 20;
/// The fastest level with entropy coding: the noise in a scan has no repetitions, but few values.
const LEVEL: u32 = 1;

/// For whom `ros2 bag play` keeps the last message of a topic.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kept {
    ForNobody,
    /// For subscribers that come later: durability `transient_local`, as `/tf_static` and maps have
    /// it.
    ForLater,
}

#[derive(Debug)]
pub struct Topic<T> {
    index: usize,
    message: PhantomData<T>,
}

struct Described {
    channel: u16,
    name: String,
    type_name: String,
    /// The qualities of service, as YAML.
    qualities: String,
    messages: u64,
}

/// Writes a bag: a folder with a `metadata.yaml`, or one file if the name ends in `.mcap`. It has
/// another name until it is complete.
pub struct BagWriter {
    path: PathBuf,
    aside: PathBuf,
    file_name: Option<String>,
    mcap: Writer<BufWriter<File>>,
    topics: Vec<Described>,
    times: Option<(i64, i64)>,
    committed: bool,
}

impl BagWriter {
    /// Begins a bag, which must not exist.
    pub fn create(path: &Path) -> Result<Self, RecordingError> {
        require_new(path)?;
        let name = path.file_name().unwrap_or_default().to_string_lossy();
        let aside = path.with_file_name(format!(".{name}.tmp"));
        let is_file = path.extension().is_some_and(|it| it == "mcap");
        let file_name = (!is_file).then(|| format!("{name}_0.mcap"));
        let failed = |error: io::Error| unwritable(path, error);
        let parent = path.parent().unwrap_or(Path::new(""));
        if !parent.as_os_str().is_empty() {
            fs::create_dir_all(parent).map_err(failed)?;
        }
        let file = match &file_name {
            None => aside.clone(),
            Some(name) => aside.join(name),
        };
        let Some(file) = create_aside(&aside, &file).map_err(failed)? else {
            let reason = "another command is writing it; wait for that, or give another name";
            return Err(unwritable(path, reason));
        };
        // Another command may have come to its end meanwhile.
        require_new(path)?;
        let options = WriteOptions::new()
            .profile(PROFILE)
            .library(concat!("gyre ", env!("CARGO_PKG_VERSION")))
            .compression(Some(Compression::Zstd))
            .compression_level(LEVEL)
            .compression_threads(0)
            .chunk_size(Some(CHUNK_BYTES));
        let mcap = options.create(BufWriter::new(file));
        Ok(Self {
            path: path.to_owned(),
            aside,
            file_name,
            mcap: mcap.map_err(|error| unwritable(path, error))?,
            topics: Vec::new(),
            times: None,
            committed: false,
        })
    }

    pub fn topic<T: Ros2Message>(
        &mut self,
        name: &str,
        kept: Kept,
    ) -> Result<Topic<T>, RecordingError> {
        let definition = T::DEFINITION;
        let mut described = Described {
            channel: 0,
            name: name.to_owned(),
            type_name: definition.type_name(),
            qualities: qualities(kept),
            messages: 0,
        };
        let channel = self.add_channel(&described, &definition.text());
        described.channel = channel.map_err(|error| unwritable(&self.path, error))?;
        self.topics.push(described);
        Ok(Topic {
            index: self.topics.len() - 1,
            message: PhantomData,
        })
    }

    fn add_channel(&mut self, topic: &Described, schema: &str) -> Result<u16, McapError> {
        let (name, schema) = (&topic.type_name, schema.as_bytes());
        let schema = self.mcap.add_schema(name, "ros2msg", schema)?;
        let qualities = ("offered_qos_profiles".to_owned(), topic.qualities.clone());
        let metadata = BTreeMap::from([qualities]);
        self.mcap.add_channel(schema, &topic.name, "cdr", &metadata)
    }

    /// Writes a message that was received at `log_ns`, ns since 1970.
    pub fn write<T: Ros2Message>(
        &mut self,
        topic: &Topic<T>,
        log_ns: i64,
        message: &T,
    ) -> Result<(), RecordingError> {
        let data = encode(message)
            .map_err(|error| RecordingError::Other(format!("cannot write a message: {error}")))?;
        let topic = &mut self.topics[topic.index];
        let time = u64::try_from(log_ns).unwrap_or_default();
        let header = MessageHeader {
            channel_id: topic.channel,
            sequence: topic.messages as u32,
            log_time: time,
            publish_time: time,
        };
        topic.messages += 1;
        let (first, last) = self.times.unwrap_or((log_ns, log_ns));
        self.times = Some((first.min(log_ns), last.max(log_ns)));
        let written = self.mcap.write_to_known_channel(&header, &data);
        written.map_err(|error| unwritable(&self.path, error))
    }

    pub fn counts(&self) -> impl Iterator<Item = (&str, u64)> {
        let topics = self.topics.iter();
        topics.map(|topic| (topic.name.as_str(), topic.messages))
    }

    pub fn finish(mut self) -> Result<(), RecordingError> {
        let path = self.path.clone();
        let failed = |error: io::Error| unwritable(&path, error);
        self.mcap
            .finish()
            .map_err(|error| unwritable(&path, error))?;
        let mut files = Vec::new();
        if let Some(file) = &self.file_name {
            let text = description(file, &self.topics, self.times);
            let description = self.aside.join(METADATA);
            fs::write(&description, text).map_err(failed)?;
            files.extend([self.aside.join(file), description]);
        }
        // A power failure leaves no name of a bag without its content.
        files.push(self.aside.clone());
        for file in files {
            let synchronised = File::open(file).and_then(|file| file.sync_all());
            synchronised.map_err(failed)?;
        }
        fs::rename(&self.aside, &self.path).map_err(failed)?;
        self.committed = true;
        let folder = self.path.parent().map_or(Ok(()), gyre_storage::sync_folder);
        folder.map_err(|error| unwritable(&path, error))
    }
}

impl Drop for BagWriter {
    fn drop(&mut self) {
        if !self.committed {
            remove(&self.aside);
        }
    }
}

/// Creates the file of an incomplete bag, and the folder of both where `aside` is a different one;
/// `None` while another command writes the bag.
fn create_aside(aside: &Path, file: &Path) -> io::Result<Option<File>> {
    // Locked until it is removed, so that no other command takes it for its own.
    let left_over = try_lock_existing(file);
    match &left_over {
        Ok(Attempt::Held(_)) => return Ok(None),
        // Another command may create it by now: it is not removed.
        Err(error) if error.kind() == io::ErrorKind::NotFound && aside == file => {}
        _ => remove(aside),
    }
    if aside != file {
        fs::create_dir(aside)?;
    }
    Ok(match try_lock(file)? {
        Attempt::Locked(file) => Some(file),
        Attempt::Held(_) => None,
    })
}

fn require_new(path: &Path) -> Result<(), RecordingError> {
    let there = "it exists; remove it, or give another name";
    match path.exists() {
        true => Err(unwritable(path, there)),
        false => Ok(()),
    }
}

/// Removes the leftovers of an earlier writer. If the removal fails, the next creation reports it.
fn remove(aside: &Path) {
    let _ = fs::remove_dir_all(aside).or_else(|_| fs::remove_file(aside));
}

fn unwritable(path: &Path, reason: impl Display) -> RecordingError {
    RecordingError::Other(format!("cannot write {}: {reason}", path.display()))
}

/// Returns the qualities of service of a topic, as `rosbag2` writes them: the last message or a
/// hundred kept, reliable, no deadlines.
fn qualities(kept: Kept) -> String {
    // The numbers are defined by rmw: history keep last, reliability reliable, durability transient
    // local or volatile.
    let (depth, durability) = match kept {
        Kept::ForLater => (1, 1),
        Kept::ForNobody => (100, 2),
    };
    let endless = "\n    sec: 9223372036\n    nsec: 854775807";
    format!(
        "- history: 1\n  depth: {depth}\n  reliability: 1\n  durability: {durability}\n  deadline:{endless}\n  lifespan:{endless}\n  \
         liveliness: 1\n  liveliness_lease_duration:{endless}\n  avoid_ros_namespace_conventions: false"
    )
}

/// Returns the `metadata.yaml` of a bag with one file, from the first to the last time in it, ns
/// since 1970; in version 5 of ROS 2 Humble, which later versions read.
fn description(file: &str, topics: &[Described], times: Option<(i64, i64)>) -> String {
    let (first_ns, last_ns) = times.unwrap_or_default();
    let duration_ns = last_ns - first_ns;
    let messages: u64 = topics.iter().map(|topic| topic.messages).sum();
    let file = quoted(file);
    let mut text = format!(
        "rosbag2_bagfile_information:\n  version: 5\n  storage_identifier: mcap\n  duration:\n    nanoseconds: {duration_ns}\n  \
         starting_time:\n    nanoseconds_since_epoch: {first_ns}\n  message_count: {messages}\n  topics_with_message_count:\n"
    );
    for topic in topics {
        let _ = write!(
            text,
            "    - topic_metadata:\n        name: {}\n        type: {}\n        serialization_format: cdr\n        \
             offered_qos_profiles: {}\n      message_count: {}\n",
            quoted(&topic.name),
            quoted(&topic.type_name),
            quoted(&topic.qualities),
            topic.messages
        );
    }
    let _ = write!(
        text,
        "  compression_format: \"\"\n  compression_mode: \"\"\n  relative_file_paths:\n    - {file}\n  files:\n    - path: {file}\n      \
         starting_time:\n        nanoseconds_since_epoch: {first_ns}\n      duration:\n        nanoseconds: {duration_ns}\n      \
         message_count: {messages}\n"
    );
    text
}

/// Returns a text between double quotes, as JSON and YAML have it.
fn quoted(text: &str) -> String {
    serde_json::Value::from(text).to_string()
}
