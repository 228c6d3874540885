//! Sends the topics of a run to other machines.
//!
//! This process is an observer: the run neither waits for it nor fails with it. Poses and their
//! motions are sent from the journal of the run, and loops from the logs of its SLAM, so that a
//! receiver has all of them whenever it connects and however long the link was cut; the other
//! messages without a payload are kept in memory. Of scans and masked scans only the newest are
//! kept.

use std::{
    collections::BTreeMap,
    fmt, fs,
    path::Path,
    sync::Arc,
    time::{Duration, Instant},
};

use gyre_client::{MAX_WAIT, Manifest, Run, RunError, Signals, TopicObserver, log, wait_for_any};
use gyre_contract::{
    Limits, Loop, Message as _, Pose, Use, Window, composed, run::LinkConfig, topic, topic_named,
};
use gyre_journal::{self as journal, loops::LoggedLoops};
use serde::{Deserialize, Serialize};
use zenoh::{Session, Wait, query::Queryable};

use crate::{
    network::check,
    replay_buffer::{LogBuffer, MemoryBuffer, MotionBuffer, ReplayBuffer},
    request,
    serve::{Offer, Server},
    session,
};

const NAME: &str = "link";
/// Bytes that are kept of a topic without payloads: hours.
const MAX_BYTES: usize = 64 << 20;
/// Time for a receiver to reconnect if its sender was restarted just before the end.
const RECONNECT_TIME: Duration = Duration::from_secs(6);
/// Scans that are kept. With one more the newest would arrive later.
const MAX_SCANS: usize = 2;

/// The messages and bytes that were sent to all receivers together.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Sent {
    pub topics: BTreeMap<String, (u64, u64)>,
    pub is_incomplete: bool,
}

impl fmt::Display for Sent {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let topics = self.topics.iter().filter(|it| it.1.0 > 0);
        let sent = topics.map(|(topic, (messages, bytes))| {
            format!("{messages} {topic} ({:.1} MB)", *bytes as f64 / 1e6)
        });
        let sent: Vec<String> = sent.collect();
        match sent.is_empty() {
            true => write!(f, "sent nothing"),
            false => write!(f, "sent {}", sent.join(", ")),
        }
    }
}

#[derive(Clone, Debug, Serialize, Deserialize)]
pub(crate) struct RunOffer {
    pub window: Window,
    pub limits: Limits,
    pub live: bool,
    pub refines: bool,
    pub rate: Option<f64>,
    pub configuration: String,
    pub sender: String,
    /// The time of the first pose, ns since 1970, if there is one: it identifies the drive.
    pub began_ns: Option<i64>,
    pub topics: Vec<OfferedTopic>,
}

#[derive(Clone, Debug, Serialize, Deserialize)]
pub(crate) struct OfferedTopic {
    pub name: String,
    pub version: String,
}

pub(crate) fn prefix(name: &str, sender: &str) -> String {
    format!("gyre/view/{name}/from/{sender}")
}

pub(crate) fn offer_key(name: &str) -> String {
    format!("gyre/view/{name}/greeting")
}

/// Returns the time of the first pose in a folder, ns since 1970.
pub(crate) fn began_ns(out: &Path) -> Result<Option<i64>, RunError> {
    let mut poses = journal::poses(out).map_err(RunError::input)?;
    let first = poses.next().transpose();
    Ok(first
        .map_err(RunError::input)?
        .map(|pose| pose.item.stamp_ns))
}

/// Sends these topics (without any: all that the run has but scans and rasters), and waits for
/// `linger` after the end of the run for receivers that have not everything yet.
pub fn send(
    out: &Path,
    link: &LinkConfig,
    topics: &[String],
    linger: Duration,
) -> Result<Sent, RunError> {
    check(link)?;
    let run = Run::open(out)?;
    let _log = log::start_log(run.manifest(), NAME)?;
    let signals = Signals::install()?;
    let pause = || signals.sleep(MAX_WAIT);
    let Some(session) = session::open(link, pause)? else {
        return Ok(Sent::default());
    };
    let sending = Sending::begin(&run, &link.name, topics, &session)?;
    let sent = sending.run(&signals, linger);
    let _ = session.close().wait();
    sent
}

struct Sending<'run> {
    run: &'run Run,
    topics: Vec<SentTopic>,
    _server: Server,
    _offer: Queryable<()>,
}

struct SentTopic {
    observer: TopicObserver,
    buffer: Arc<dyn ReplayBuffer>,
    offer: Arc<Offer>,
}

impl<'run> Sending<'run> {
    fn begin(
        run: &'run Run,
        link: &str,
        named: &[String],
        session: &Session,
    ) -> Result<Self, RunError> {
        let manifest = run.manifest();
        let prefix = prefix(link, &session.zid().to_string());
        let mut server = Server::new(session, &prefix, None);
        let poses = Arc::new(LogBuffer::of_poses(&manifest.out));
        let names = topics(named, manifest)?;
        let topics = names.iter().copied().map(|name| {
            let observer = run.observe_topic(topic_named(name).map_err(RunError::Input)?)?;
            let buffer = buffer(name, manifest, &poses)?;
            Ok(SentTopic {
                observer,
                offer: server.offer(name, buffer.clone())?,
                buffer,
            })
        });
        let topics = topics.collect::<Result<Vec<_>, RunError>>()?;
        Ok(Self {
            run,
            topics,
            _offer: offer(session, link, manifest, &names)?,
            _server: server,
        })
    }

    fn run(mut self, signals: &Signals, linger: Duration) -> Result<Sent, RunError> {
        let mut ended: Option<Instant> = None;
        loop {
            // Before the queues are read: messages from before the end are still in them.
            let has_ended = self.run.has_ended();
            self.topics.iter_mut().try_for_each(SentTopic::take)?;
            let has_ended = has_ended || self.topics.iter().all(|it| it.observer.has_ended());
            if has_ended && ended.is_none() {
                ended = Some(Instant::now());
                let mut topics = self.topics.iter();
                topics.try_for_each(|topic| topic.buffer.end())?;
            }
            if let Some(ended) = ended {
                let has_receivers = self.topics.iter().any(|it| it.offer.has_receivers());
                let is_expected = ended.elapsed() < RECONNECT_TIME && !has_receivers;
                let is_complete = self.is_complete() && !is_expected;
                if is_complete || ended.elapsed() > linger {
                    // Time to send the last answer.
                    signals.sleep(MAX_WAIT)?;
                    return Ok(self.sent());
                }
            }
            let listeners = self.topics.iter().map(|it| it.observer.listener());
            let listeners: Vec<_> = listeners.collect();
            let stops = match ended {
                Some(_) => signals.sleep(MAX_WAIT)?,
                None => wait_for_any(signals, &listeners, MAX_WAIT)?,
            };
            if stops {
                return Ok(self.sent());
            }
        }
    }

    fn is_complete(&self) -> bool {
        self.topics.iter().all(|topic| topic.offer.is_done())
    }

    fn sent(&self) -> Sent {
        let topics = self.topics.iter();
        let topics = topics.map(|topic| (topic.observer.topic().to_owned(), topic.offer.sent()));
        Sent {
            topics: topics.collect(),
            is_incomplete: !self.is_complete(),
        }
    }
}

impl SentTopic {
    fn take(&mut self) -> Result<(), RunError> {
        loop {
            match self.observer.take() {
                Ok(Some(message)) => self.buffer.add(&message),
                Ok(None) => return Ok(()),
                // The run judges the messages of its stages. The message counts as missed.
                Err(RunError::Malformed { .. }) => {}
                Err(error) => return Err(error),
            }
        }
    }
}

/// Returns the buffer of a topic. The poses come from the run.
fn buffer(
    name: &str,
    manifest: &Manifest,
    poses: &Arc<LogBuffer>,
) -> Result<Arc<dyn ReplayBuffer>, RunError> {
    let composed = composed(manifest.refines).name;
    let buffer: Arc<dyn ReplayBuffer> = match name {
        Pose::TOPIC => poses.clone(),
        Loop::TOPIC => {
            let loops = LoggedLoops::open(&manifest.out)?;
            Arc::new(LogBuffer::of_loops(loops))
        }
        _ if name == composed => Arc::new(MotionBuffer(poses.clone())),
        _ if is_lossless(name) => Arc::new(MemoryBuffer::bounded(usize::MAX, MAX_BYTES)),
        _ => Arc::new(MemoryBuffer::of(MAX_SCANS)),
    };
    Ok(buffer)
}

/// Returns whether no message of a topic may be missed: all but the large ones with payloads.
pub(crate) fn is_lossless(topic: &str) -> bool {
    !gyre_contract::topic(topic).is_some_and(|it| it.is(Use::Large))
}

/// Returns the topics to send; poses are among them, since the motions come with them.
fn topics(named: &[String], manifest: &Manifest) -> Result<Vec<&'static str>, RunError> {
    let named: Vec<&str> = match named.is_empty() {
        true => gyre_contract::all()
            .filter(|topic| topic.is(Use::Linked) && manifest.has_topic(topic.name))
            .map(|topic| topic.name)
            .collect(),
        false => named.iter().map(String::as_str).collect(),
    };
    let mut topics = Vec::new();
    for name in named.into_iter().chain([Pose::TOPIC]) {
        let name = topic_named(name).map_err(RunError::Input)?.name;
        if !topics.contains(&name) {
            topics.push(name);
        }
    }
    Ok(topics)
}

fn offer(
    session: &Session,
    link: &str,
    manifest: &Manifest,
    names: &[&'static str],
) -> Result<Queryable<()>, RunError> {
    let path = manifest.root.join("config.toml");
    let offered = |name: &&'static str| OfferedTopic {
        name: (*name).to_owned(),
        version: topic(name).map_or("", |topic| topic.header.name).to_owned(),
    };
    let run = RunOffer {
        window: manifest.window,
        limits: manifest.limits,
        live: manifest.live,
        refines: manifest.refines,
        rate: manifest.rate,
        configuration: fs::read_to_string(&path)
            .map_err(|source| RunError::File { path, source })?,
        sender: session.zid().to_string(),
        began_ns: None,
        topics: names.iter().map(offered).collect(),
    };
    let key = offer_key(link);
    let out = manifest.out.clone();
    request::answer(session, key, "offer a run", move || RunOffer {
        began_ns: began_ns(&out).ok().flatten(),
        ..run.clone()
    })
}
