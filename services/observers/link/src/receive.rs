//! Looks on at a run of another machine: what comes is published here as a run of its own, for everything that observes runs.

use std::{
    collections::BTreeMap,
    fmt, fs,
    io::ErrorKind,
    path::{Path, PathBuf},
    time::Duration,
};

use gyre_journal::{self as journal, Journal};
use gyre_messages::{Correction, Limits, Message as _, Pose, PoseHeader, flag, topic};
use gyre_stage::{
    Manifest, launch,
    source::RecordedMessage,
    wake::{MAX_WAIT, Signals},
};
use gyre_supervise::rig::{Feed, Recorded, Rig};
use zenoh::{Session, Wait, handlers::FifoChannelHandler, qos::Priority, query::Reply};

use crate::{
    LinkError, Network,
    fetch::{Fetcher, Request},
    send::{Greeting, OfferedTopic, greeting_key, prefix},
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

/// What is answered to a question.
type Answers = FifoChannelHandler<Reply>;

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
    /// Whether it ended on a request to stop, before the run.
    pub is_interrupted: bool,
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

fn require_same(offered: &OfferedTopic) -> Result<(), LinkError> {
    let ours = topic(&offered.name).map(|topic| topic.header.name);
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
    let Seen { session, greeting } = seen;
    let mut mirror = Mirror {
        session: session.clone(),
        link: options.network.name.clone(),
        receiver: receiver(&options.out, &session)?,
        topics: Vec::new(),
        journal,
        next_pose,
        question: None,
        greeting,
        sleeper,
        rig,
    };
    for offered in mirror.greeting.topics.clone() {
        if options.topics.is_empty() || options.topics.contains(&offered.name) {
            mirror.topics.push(mirror.open(&offered)?);
        }
    }
    let received = mirror.run();
    // All at once: each may wait for a sender that does not answer.
    let topics = mirror.topics.iter();
    topics.for_each(|topic| topic.fetcher.begin_to_leave());
    mirror
        .topics
        .into_iter()
        .for_each(|topic| topic.fetcher.leave());
    let _ = session.close().wait();
    received
}

/// Returns what tells this receiver from others, and is the same when it begins again: the name of the first session that has written to the
/// folder.
fn receiver(out: &Path, session: &Session) -> Result<String, LinkError> {
    let path = out.join("journal/receiver");
    let failed = |source| LinkError::File {
        path: path.clone(),
        source,
    };
    match fs::read_to_string(&path) {
        Ok(name) if !name.is_empty() && name.chars().all(|c| c.is_ascii_hexdigit()) => Ok(name),
        Err(error) if error.kind() != ErrorKind::NotFound => Err(failed(error)),
        _ => {
            let name = session.zid().to_string();
            fs::write(&path, &name).map_err(failed)?;
            Ok(name)
        }
    }
}

/// Returns the number of the first pose that is not in the journal, which is of this drive or empty.
fn next_pose(journal: &Journal, greeting: &Greeting, out: &Path) -> Result<u64, LinkError> {
    let (last, ended) = journal.last(1)?;
    let Some(last) = last.first() else {
        return Ok(0);
    };
    match began_ns(out)? == greeting.began_ns && !ended {
        true => Ok(last.item.seq.saturating_add(1)),
        false => Err(LinkError::Refused(format!(
            "{} has the poses of another drive: choose another folder",
            out.display()
        ))),
    }
}

/// Returns the time of the first pose in a folder, ns since 1970.
fn began_ns(out: &Path) -> Result<Option<i64>, LinkError> {
    let mut records = journal::records(&journal::path(out))?.into_iter().flatten();
    Ok(records.next().transpose()?.map(|pose| pose.item.stamp_ns))
}

/// The run that is made of another one.
struct Mirror<'a> {
    session: Session,
    /// The name of the link.
    link: String,
    receiver: String,
    greeting: Greeting,
    /// Who is there, while nothing comes.
    question: Option<Answers>,
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
    fn open(&self, offered: &OfferedTopic) -> Result<Topic, LinkError> {
        let other = || LinkError::Refused(OTHER_VERSION.to_owned());
        let topic = topic(&offered.name).ok_or_else(other)?;
        let from = match topic.name {
            Pose::TOPIC => self.next_pose,
            _ => 0,
        };
        Ok(Topic {
            name: topic.name,
            header_bytes: topic.header.bytes,
            fetcher: self.fetch(topic.name, from, offered.is_lossless),
            feed: self.rig.feed(topic.name)?,
            next: None,
            count: Count {
                is_lossless: offered.is_lossless,
                ..Count::default()
            },
        })
    }

    /// Asks the sender for the messages of a topic from one on.
    fn fetch(&self, topic: &str, from: u64, is_lossless: bool) -> Fetcher {
        let request = Request {
            key: format!("{}/{topic}", prefix(&self.link, &self.greeting.sender)),
            from,
            receiver: self.receiver.clone(),
            // A scan takes long, and the poses need not wait for it.
            priority: match is_lossless {
                true => Priority::InteractiveHigh,
                false => Priority::DataLow,
            },
        };
        Fetcher::start(&self.session, request, self.sleeper.waker())
    }

    /// Asks whether another sender is there, and goes on with it if it sends the same drive.
    fn look_for_another_sender(&mut self) -> Result<(), LinkError> {
        let Some(question) = &self.question else {
            let asked = self.session.get(greeting_key(&self.link)).timeout(ANSWER);
            let asked = asked.wait();
            self.question = Some(asked.map_err(|e| LinkError::zenoh("ask for a run", &e))?);
            return Ok(());
        };
        let answer = match question.try_recv() {
            Ok(None) => return Ok(()),
            Ok(Some(reply)) => reply.into_result().ok(),
            Err(_) => None,
        };
        self.question = None;
        let Some(sample) = answer else {
            return Ok(());
        };
        let other: Greeting = serde_json::from_slice(&sample.payload().to_bytes())
            .map_err(|_| LinkError::Refused(OTHER_VERSION.to_owned()))?;
        if other.sender == self.greeting.sender {
            return Ok(());
        }
        let is_same = (other.window, other.limits, other.live, other.refines)
            == (
                self.greeting.window,
                self.greeting.limits,
                self.greeting.live,
                self.greeting.refines,
            );
        other.topics.iter().try_for_each(require_same)?;
        let began_ns = match self.next_pose {
            0 => self.greeting.began_ns,
            _ => began_ns(&self.rig.manifest().out)?,
        };
        // Without a pose of the earlier drive nothing of it may be there.
        let goes_on = match began_ns {
            Some(_) => other.began_ns == began_ns,
            None => self.topics.iter().all(|topic| topic.next.is_none()),
        };
        if !is_same || !goes_on {
            return Err(LinkError::Refused(
                "the sender is at another drive now: what came of this one is whole up to here; receive the other one into another folder".to_owned(),
            ));
        }
        let is_sent = |topic: &Topic| other.topics.iter().any(|it| it.name == topic.name);
        if let Some(topic) = self.topics.iter().find(|topic| !is_sent(topic)) {
            return Err(LinkError::Refused(format!(
                "the sender has begun again and does not send `{}` any more: give it the same --topics",
                topic.name
            )));
        }
        self.greeting = other;
        for place in 0..self.topics.len() {
            let topic = &self.topics[place];
            if topic.fetcher.has_ended() {
                continue;
            }
            let from = match topic.name {
                Pose::TOPIC => self.next_pose,
                _ => topic.next.unwrap_or_default(),
            };
            self.topics[place].fetcher = self.fetch(topic.name, from, topic.count.is_lossless);
        }
        Ok(())
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
                return Ok(self.received(false));
            }
            let is_live =
                |topic: &Topic| topic.fetcher.is_connected() && !topic.fetcher.has_ended();
            let is_connected = self.topics.iter().any(is_live);
            status.update(is_connected, self.next_pose);
            match is_connected {
                true => self.question = None,
                false => self.look_for_another_sender()?,
            }
            let feeds: Vec<&dyn Feed> = self.topics.iter().map(|topic| &*topic.feed).collect();
            for feed in &feeds {
                feed.answer_handshakes()?;
            }
            let descriptor = self.sleeper.descriptor();
            if self
                .rig
                .sleep_until_readable(&feeds, descriptor, MAX_WAIT)?
            {
                return Ok(self.received(true));
            }
        }
    }

    fn received(&self, is_interrupted: bool) -> Received {
        let topics = self.topics.iter();
        Received {
            is_interrupted,
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
