//! Looks on at a run of another machine: what comes is published here as a run of its own, for everything that observes runs.

use std::{
    collections::BTreeMap,
    fmt,
    path::{Path, PathBuf},
    time::Duration,
};

use gyre_messages::{Correction, Limits, Message as _, Pose, PoseHeader, flag, topic};
use gyre_pose_integration::journal::{self, Journal};
use gyre_stage::{
    Manifest, launch,
    source::RecordedMessage,
    supervise::rig::{Feed, Recorded, Rig},
    wake::{MAX_WAIT, Signals},
};
use zenoh::{Session, Wait, qos::Priority};

use crate::{
    LinkError, Network,
    fetch::{Fetcher, Request},
    send::{Greeting, Offered, greeting_key, prefix},
    status::Status,
    wake::Sleeper,
};

/// The name of this process in the log.
const NAME: &str = "link";
/// Time for an answer of the sender.
const ANSWER: Duration = Duration::from_secs(1);
/// Time between two questions whether it is there.
const PAUSE: Duration = Duration::from_millis(200);

/// What to receive.
#[derive(Clone, Debug)]
pub struct ReceiveOptions {
    /// The folder of the run that is made of it.
    pub out: PathBuf,
    /// How the sender is reached.
    pub network: Network,
    /// The program of the guardian.
    pub gyre: String,
    /// Topics to receive of those that are sent; empty: all.
    pub topics: Vec<String>,
}

/// A run that can be looked at.
pub struct Seen {
    session: Session,
    greeting: Greeting,
}

/// What was received.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Received {
    /// Of each topic the messages that came, those that were missed, and whether none may be missed.
    pub topics: BTreeMap<String, Count>,
}

/// The messages of a topic.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Count {
    /// Messages that came.
    pub received: u64,
    /// Messages between them that did not.
    pub missed: u64,
    /// Whether none may be missed.
    pub is_lossless: bool,
}

impl Received {
    /// Returns whether nothing was missed that must not be.
    pub fn is_complete(&self) -> bool {
        let mut topics = self.topics.values();
        topics.all(|count| !count.is_lossless || count.missed == 0)
    }
}

impl fmt::Display for Received {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let list = |number: fn(&Count) -> u64| {
            let topics = self.topics.iter().filter(|(_, count)| number(count) > 0);
            let topics: Vec<String> = topics
                .map(|(topic, count)| format!("{} {topic}", number(count)))
                .collect();
            match topics.is_empty() {
                true => "nothing".to_owned(),
                false => topics.join(", "),
            }
        };
        let (received, missed) = (list(|it| it.received), list(|it| it.missed));
        write!(f, "received {received}; missed {missed}")
    }
}

/// Waits for the sender. `None` on a request to stop.
///
/// # Errors
/// The network cannot be used, or the sender is another version.
pub fn ask(network: &Network, signals: &Signals) -> Result<Option<Seen>, LinkError> {
    network.check()?;
    let Some(session) = network.open(|| Ok(signals.sleep(PAUSE)?))? else {
        return Ok(None);
    };
    loop {
        let key = greeting_key(&network.name);
        let asked = session.get(key).timeout(ANSWER).wait();
        let replies = asked.map_err(|e| LinkError::zenoh("ask for a run", &e))?;
        let reply = replies
            .recv()
            .ok()
            .and_then(|reply| reply.into_result().ok());
        if let Some(sample) = reply {
            let greeting: Greeting = serde_json::from_slice(&sample.payload().to_bytes())
                .map_err(|_| LinkError::Refused(OTHER_VERSION.to_owned()))?;
            greeting.topics.iter().try_for_each(require_same)?;
            return Ok(Some(Seen { session, greeting }));
        }
        if signals.sleep(PAUSE)? {
            return Ok(None);
        }
    }
}

const OTHER_VERSION: &str = "the sender is another version of gyre: install the same on both";

fn require_same(offered: &Offered) -> Result<(), LinkError> {
    let ours = topic(&offered.name).map(|topic| (topic.header_type)());
    match ours == Some(&*offered.version) {
        true => Ok(()),
        false => Err(LinkError::Refused(OTHER_VERSION.to_owned())),
    }
}

impl Seen {
    /// Returns the manifest of a run that is made of this one.
    pub fn manifest(&self, out: &Path) -> Manifest {
        let Greeting {
            window,
            limits,
            live,
            refines,
            rate,
            ..
        } = self.greeting;
        Manifest {
            prefix: String::new(),
            root: PathBuf::new(),
            out: out.to_owned(),
            window,
            limits,
            live,
            refines,
            rate,
            build: String::new(),
        }
    }
}

/// Receives until the run ends, or a signal requests a stop.
///
/// # Errors
/// The folder has poses of another drive, shared memory cannot be used, or a failure of the transport.
pub fn receive(
    options: &ReceiveOptions,
    seen: Seen,
    signals: &Signals,
) -> Result<Received, LinkError> {
    let manifest = seen.manifest(&options.out);
    let journal = Journal::open(&journal::path(&manifest.out))?;
    let next_pose = next_pose(&journal, &seen.greeting, &options.out)?;
    let guardian = [options.gyre.clone(), "guard".to_owned()];
    let rig = Rig::new(manifest, &seen.greeting.configuration, &guardian, signals)?;
    let _log = launch::start_log(rig.manifest(), NAME)?;
    let sleeper = Sleeper::new().map_err(|e| LinkError::zenoh("make a socket", &e))?;
    let mut mirror = Mirror {
        topics: Vec::new(),
        journal,
        next_pose,
        sleeper,
        rig,
    };
    for offered in &seen.greeting.topics {
        if options.topics.is_empty() || options.topics.contains(&offered.name) {
            let topic = mirror.open(&seen.session, &options.network.name, offered)?;
            mirror.topics.push(topic);
        }
    }
    let received = mirror.run();
    let _ = seen.session.close().wait();
    received
}

/// Returns the number of the first pose that is not in the journal, which is of this drive or empty.
fn next_pose(journal: &Journal, greeting: &Greeting, out: &Path) -> Result<u64, LinkError> {
    let (last, ended) = journal.last(1)?;
    let Some(last) = last.first() else {
        return Ok(0);
    };
    let mut records = journal::records(&journal::path(out))?.into_iter().flatten();
    let began_ns = records.next().transpose()?.map(|pose| pose.item.stamp_ns);
    match began_ns == greeting.began_ns && !ended {
        true => Ok(last.item.seq.saturating_add(1)),
        false => Err(LinkError::Refused(format!(
            "{} has the poses of another drive: choose another folder",
            out.display()
        ))),
    }
}

/// The run that is made of another one.
struct Mirror<'a> {
    topics: Vec<Topic>,
    /// The poses that have come: they are not asked for again.
    journal: Journal,
    next_pose: u64,
    sleeper: Sleeper,
    rig: Rig<'a>,
}

struct Topic {
    name: &'static str,
    header_bytes: usize,
    fetcher: Fetcher,
    feed: Box<dyn Feed>,
    next: Option<u64>,
    count: Count,
}

impl Mirror<'_> {
    fn open(&self, session: &Session, link: &str, offered: &Offered) -> Result<Topic, LinkError> {
        let other = || LinkError::Refused(OTHER_VERSION.to_owned());
        let topic = topic(&offered.name).ok_or_else(other)?;
        let request = Request {
            key: format!("{}/{}", prefix(link), topic.name),
            from: match topic.name {
                Pose::TOPIC => self.next_pose,
                _ => 0,
            },
            // A scan takes long, and the poses need not wait for it.
            priority: match offered.is_lossless {
                true => Priority::InteractiveHigh,
                false => Priority::DataLow,
            },
        };
        Ok(Topic {
            name: topic.name,
            header_bytes: topic.header_bytes,
            fetcher: Fetcher::start(session, request, self.sleeper.waker()),
            feed: self.rig.feed(topic.name)?,
            next: None,
            count: Count {
                is_lossless: offered.is_lossless,
                ..Count::default()
            },
        })
    }

    fn run(&mut self) -> Result<Received, LinkError> {
        let mut status = Status::of("sender");
        let limits = self.rig.manifest().limits;
        loop {
            self.sleeper.clear();
            let have_ended = self.topics.iter().all(|topic| topic.fetcher.has_ended());
            for topic in &mut self.topics {
                while let Some(bytes) = topic.fetcher.next() {
                    let message = topic.message(bytes)?;
                    if topic.name == Pose::TOPIC {
                        self.next_pose =
                            keep(&mut self.journal, &message, self.next_pose, &limits)?;
                    }
                    topic.feed.send(&Recorded::from_bytes(message))?;
                }
            }
            if have_ended {
                return Ok(self.received());
            }
            let is_connected = self.topics.iter().any(|topic| topic.fetcher.is_connected());
            status.update(is_connected, self.next_pose);
            let feeds: Vec<&dyn Feed> = self.topics.iter().map(|topic| &*topic.feed).collect();
            for feed in &feeds {
                feed.answer_handshakes()?;
            }
            let descriptor = self.sleeper.descriptor();
            if self
                .rig
                .sleep_until_readable(&feeds, descriptor, MAX_WAIT)?
            {
                return Ok(self.received());
            }
        }
    }

    fn received(&self) -> Received {
        let topics = self.topics.iter();
        Received {
            topics: topics
                .map(|topic| (topic.name.to_owned(), topic.count))
                .collect(),
        }
    }
}

impl Topic {
    /// Returns a message that has come, and counts those between it and the one before.
    fn message(&mut self, bytes: Vec<u8>) -> Result<RecordedMessage, LinkError> {
        let Some((header, payload)) = bytes.split_at_checked(self.header_bytes) else {
            let reason = format!("a message of {} bytes is too short", bytes.len());
            return Err(LinkError::Refused(reason));
        };
        let message = RecordedMessage {
            header: header.to_vec(),
            payload: payload.to_vec(),
        };
        let seq = message.item().map_or(0, |item| item.seq);
        self.count.received += 1;
        // The numbers of corrections count what they are made of, and each replaces those before.
        if self.name != Correction::TOPIC {
            self.count.missed += seq.saturating_sub(self.next.unwrap_or(seq));
        }
        self.next = Some(seq.saturating_add(1));
        Ok(message)
    }
}

/// Journals a pose that keeps its contract, and returns the number of the next one.
fn keep(
    journal: &mut Journal,
    message: &RecordedMessage,
    next: u64,
    limits: &Limits,
) -> Result<u64, LinkError> {
    let pose: Option<PoseHeader> = bytemuck::try_pod_read_unaligned(&message.header).ok();
    let is_new = |pose: &PoseHeader| {
        pose.item.seq == next && !pose.item.is(flag::END) && Pose::check(pose, &[], limits).is_ok()
    };
    let Some(pose) = pose.filter(is_new) else {
        return Ok(next);
    };
    journal.append(&pose)?;
    Ok(next + 1)
}
