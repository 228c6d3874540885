//! Lets other machines look on at a run.
//!
//! To the run this process is an observer: the run neither waits for it nor fails with it. What must not be lost is sent from where it is
//! kept: poses and their motions from the journal of the run, and loops from the logs of its SLAM, so that a receiver has all of them whenever
//! it comes and however long the link was cut; the other messages without a payload from memory. Of scans and masked scans only the newest are
//! kept.

use std::{
    collections::BTreeMap,
    fmt, fs,
    path::PathBuf,
    sync::Arc,
    time::{Duration, Instant},
};

use gyre_loop_closure::LoggedLoops;
use gyre_messages::{
    Limits, Loop, Masked, Message as _, Motion, Pose, Refined, Scan, Sender, Window, topic,
};
use gyre_stage::{
    Manifest, StageError, launch,
    observer::{ObservedRun, wait_for_any},
    wake::{MAX_WAIT, Signals},
};
use serde::{Deserialize, Serialize};
use zenoh::{Session, Wait, query::Queryable};

use crate::{
    LinkError, Network,
    observing::{Observing, observe},
    serve::{Offer, Server},
    tape::{Loops, Message, Motions, PoseLog, Poses, Ring, Tape},
};

/// The name of this process in the log of the run.
const NAME: &str = "link";
/// The topics that are sent unless others are named, of those that the run has.
const DEFAULT: [&str; 6] = ["motion", "refined", "pose", "loop", "correction", "fix"];
/// Bytes that are kept of a topic without payloads: hours.
const KEPT_BYTES: usize = 64 << 20;
/// Time in which a receiver comes back whose sender has begun again just before the end.
const RECONNECTS: Duration = Duration::from_secs(6);
/// Scans that are kept. With one more the newest would come later.
const KEPT_SCANS: usize = 2;

/// What to send, and to whom.
#[derive(Clone, Debug)]
pub struct SendOptions {
    /// The folder of the run's results.
    pub out: PathBuf,
    /// How receivers connect.
    pub network: Network,
    /// The topics; empty: all that the run has but scans and rasters.
    pub topics: Vec<String>,
    /// Time to wait, after the end of the run, for receivers that have not everything yet.
    pub linger: Duration,
}

/// What was sent of each topic: messages and bytes, to all receivers together.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Sent {
    /// By topic.
    pub topics: BTreeMap<String, (u64, u64)>,
    /// Whether a receiver was out of reach when this ended, which had not received everything.
    pub is_incomplete: bool,
}

impl fmt::Display for Sent {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let sent = self
            .topics
            .iter()
            .filter(|(_, (messages, _))| *messages > 0);
        let sent: Vec<String> = sent
            .map(|(topic, (messages, bytes))| {
                format!("{messages} {topic} ({:.1} MB)", *bytes as f64 / 1e6)
            })
            .collect();
        match sent.is_empty() {
            true => write!(f, "sent nothing"),
            false => write!(f, "sent {}", sent.join(", ")),
        }
    }
}

/// What a receiver needs to know of the run.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(crate) struct Greeting {
    pub window: Window,
    pub limits: Limits,
    pub live: bool,
    pub refines: bool,
    pub rate: Option<f64>,
    pub configuration: String,
    /// Tells one sender from the next: it is part of the keys.
    pub sender: String,
    /// Time of the first pose, ns since 1970, if there is one: it tells one drive from another.
    pub began_ns: Option<i64>,
    pub topics: Vec<OfferedTopic>,
}

/// A topic that is sent.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(crate) struct OfferedTopic {
    pub name: String,
    /// The type of its header, with the version.
    pub version: String,
    /// Whether no message of it may be missed.
    pub is_lossless: bool,
}

/// Returns the prefix of the keys of the topics that one sender offers.
pub(crate) fn prefix(name: &str, sender: &str) -> String {
    format!("gyre/view/{name}/from/{sender}")
}

/// Returns the key at which any sender of a link says what it offers.
pub(crate) fn greeting_key(name: &str) -> String {
    format!("gyre/view/{name}/greeting")
}

/// Sends the topics of a run until it ends and all receivers have what they are to have, or a signal requests a stop.
///
/// # Errors
/// There is no such run or topic, or the network cannot be used.
pub fn send(options: &SendOptions) -> Result<Sent, LinkError> {
    options.network.check()?;
    let run = ObservedRun::writing_to(&options.out)?;
    let _log = launch::start_log(run.manifest(), NAME)?;
    let signals = Signals::install()?;
    let pause = || Ok(signals.sleep(MAX_WAIT)?);
    let Some(session) = options.network.open(pause)? else {
        return Ok(Sent::default());
    };
    let sending = Sending::begin(&run, options, &session)?;
    let sent = sending.run(&signals, options.linger);
    let _ = session.close().wait();
    sent
}

struct Sending<'run> {
    run: &'run ObservedRun,
    topics: Vec<Topic<'run>>,
    _server: Server,
    _greeting: Queryable<()>,
}

struct Topic<'run> {
    name: &'static str,
    observer: Box<dyn Observing + 'run>,
    kept: Store,
    offer: Arc<Offer>,
}

impl<'run> Sending<'run> {
    fn begin(
        run: &'run ObservedRun,
        options: &SendOptions,
        session: &Session,
    ) -> Result<Self, LinkError> {
        let manifest = run.manifest();
        let mut server = Server::new(
            session,
            &prefix(&options.network.name, &session.zid().to_string()),
            None,
        );
        let logs = Logs::of(manifest)?;
        let names = topics(&options.topics, manifest)?;
        let topics = names.iter().copied().map(|name| {
            let observer = observe(run, name).ok_or_else(|| no_topic(name))??;
            let (tape, kept) = logs.tape(name, manifest);
            Ok(Topic {
                name,
                observer,
                kept,
                offer: server.offer(name, tape)?,
            })
        });
        let topics = topics.collect::<Result<Vec<_>, LinkError>>()?;
        Ok(Self {
            run,
            topics,
            _greeting: greet(session, options, manifest, &names, logs.poses)?,
            _server: server,
        })
    }

    fn run(mut self, signals: &Signals, linger: Duration) -> Result<Sent, LinkError> {
        let mut ended: Option<Instant> = None;
        loop {
            // Before the look: what was published before the end is still in the queues.
            let has_ended = self.run.has_ended();
            self.topics.iter_mut().try_for_each(Topic::take)?;
            let has_ended = has_ended || self.topics.iter().all(|it| it.observer.has_ended());
            if has_ended && ended.is_none() {
                ended = Some(Instant::now());
                self.topics.iter().try_for_each(|topic| topic.kept.end())?;
            }
            if let Some(ended) = ended {
                let is_expected = ended.elapsed() < RECONNECTS && !self.has_receivers();
                let is_complete = self.is_complete() && !is_expected;
                if is_complete || ended.elapsed() > linger {
                    // The last answer is on its way.
                    signals.sleep(MAX_WAIT)?;
                    return Ok(self.sent(self.is_complete()));
                }
            }
            let listeners: Vec<_> = self
                .topics
                .iter()
                .map(|it| it.observer.listener())
                .collect();
            let stops = match ended {
                Some(_) => signals.sleep(MAX_WAIT)?,
                None => wait_for_any(signals, &listeners, MAX_WAIT)?,
            };
            if stops {
                return Ok(self.sent(self.is_complete()));
            }
        }
    }

    fn has_receivers(&self) -> bool {
        self.topics.iter().any(|topic| topic.offer.has_receivers())
    }

    /// Returns whether all receivers have everything, or want no more.
    fn is_complete(&self) -> bool {
        self.topics.iter().all(|topic| topic.offer.is_done())
    }

    fn sent(&self, is_complete: bool) -> Sent {
        let topics = self.topics.iter();
        Sent {
            topics: topics
                .map(|topic| (topic.name.to_owned(), topic.offer.sent()))
                .collect(),
            is_incomplete: !is_complete,
        }
    }
}

impl Topic<'_> {
    /// Takes what the run has published.
    fn take(&mut self) -> Result<(), StageError> {
        while let Some(message) = self.observer.take()? {
            let come = message.item().map_or(0, |item| item.seq.saturating_add(1));
            match &self.kept {
                Store::Ring(ring) => ring.push(Message::of(&message)),
                Store::Poses(poses) => poses.have_come(come),
                Store::Loops(loops) => loops.have_come(come),
                Store::WithPoses => {}
            }
        }
        Ok(())
    }
}

/// Where the messages of a topic are kept.
enum Store {
    Ring(Arc<Ring>),
    Poses(Arc<Poses>),
    Loops(Arc<Loops>),
    /// Its messages are made of the poses.
    WithPoses,
}

impl Store {
    fn end(&self) -> Result<(), LinkError> {
        match self {
            Self::Ring(ring) => {
                ring.end();
                Ok(())
            }
            Self::Poses(poses) => poses.end(),
            Self::Loops(loops) => loops.end(),
            Self::WithPoses => Ok(()),
        }
    }
}

/// The logs of a run, from which messages are sent that must not be missed.
struct Logs {
    poses: Arc<Poses>,
    /// In a run with SLAM.
    loops: Option<Arc<Loops>>,
}

impl Logs {
    fn of(manifest: &Manifest) -> Result<Self, LinkError> {
        let loops = manifest
            .window
            .slam
            .then(|| LoggedLoops::open(&manifest.out));
        Ok(Self {
            poses: Arc::new(Poses::of(PoseLog::of(&manifest.out))),
            loops: loops.transpose()?.map(|loops| Arc::new(Loops::of(loops))),
        })
    }

    /// Returns what a topic is sent from, and what is to be told of new messages.
    fn tape(&self, name: &str, manifest: &Manifest) -> (Arc<dyn Tape>, Store) {
        let composed = match manifest.refines {
            true => Refined::TOPIC,
            false => Motion::TOPIC,
        };
        let poses = || self.poses.clone();
        let ring = match (name, &self.loops) {
            (Pose::TOPIC, _) => return (poses(), Store::Poses(poses())),
            (Loop::TOPIC, Some(loops)) => return (loops.clone(), Store::Loops(loops.clone())),
            _ if name == composed => return (Arc::new(Motions(poses())), Store::WithPoses),
            _ if is_lossless(name) => Ring::bounded(usize::MAX, KEPT_BYTES),
            _ => Ring::of(KEPT_SCANS),
        };
        let ring = Arc::new(ring);
        (ring.clone(), Store::Ring(ring))
    }
}

/// Returns whether no message of a topic may be missed: all but those with payloads, of which there are many bytes.
fn is_lossless(topic: &str) -> bool {
    topic != Scan::TOPIC && topic != Masked::TOPIC
}

/// Returns the topics to send; poses are among them, since the motions come with them.
fn topics(named: &[String], manifest: &Manifest) -> Result<Vec<&'static str>, LinkError> {
    let known = |name: &str| topic(name).ok_or_else(|| no_topic(name));
    let has = |name: &&str| match topic(name).map(|topic| topic.sender) {
        Some(Sender::Follower(follower)) => follower.is_in(&manifest.window),
        _ => *name != Refined::TOPIC || manifest.refines,
    };
    let named: Vec<&str> = match named.is_empty() {
        true => DEFAULT.into_iter().filter(has).collect(),
        false => named.iter().map(String::as_str).collect(),
    };
    let mut topics = Vec::new();
    for name in named.into_iter().chain([Pose::TOPIC]) {
        let name = known(name)?.name;
        if !topics.contains(&name) {
            topics.push(name);
        }
    }
    Ok(topics)
}

fn no_topic(name: &str) -> LinkError {
    LinkError::Refused(format!(
        "there is no topic `{name}`: there are scan, masked, rotation, motion, refined, pose, loop, correction and fix"
    ))
}

/// Answers receivers that come.
fn greet(
    session: &Session,
    options: &SendOptions,
    manifest: &Manifest,
    names: &[&'static str],
    poses: Arc<Poses>,
) -> Result<Queryable<()>, LinkError> {
    let path = manifest.root.join("config.toml");
    let offered = |name: &&'static str| OfferedTopic {
        name: (*name).to_owned(),
        version: topic(name).map_or("", |topic| topic.header.name).to_owned(),
        is_lossless: is_lossless(name),
    };
    let greeting = Greeting {
        window: manifest.window,
        limits: manifest.limits,
        live: manifest.live,
        refines: manifest.refines,
        rate: manifest.rate,
        configuration: fs::read_to_string(&path)
            .map_err(|source| LinkError::File { path, source })?,
        sender: session.zid().to_string(),
        began_ns: None,
        topics: names.iter().map(offered).collect(),
    };
    let key = greeting_key(&options.network.name);
    let answered = key.clone();
    session
        .declare_queryable(key)
        .callback(move |query| {
            let first = poses.read(0).ok().flatten();
            let greeting = Greeting {
                began_ns: first.map(|pose| pose.item.stamp_ns),
                ..greeting.clone()
            };
            if let Ok(text) = serde_json::to_vec(&greeting) {
                let _ = query.reply(&answered, text).wait();
            }
        })
        .wait()
        .map_err(|e| LinkError::zenoh("offer a run", &e))
}
