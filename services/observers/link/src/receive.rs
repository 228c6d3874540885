//! Receives the topics of a run of another machine, and publishes them here as a run of its own,
//! for everything that observes runs.

mod mirror;

use std::{
    collections::BTreeMap,
    fmt, fs,
    io::ErrorKind,
    path::{Path, PathBuf},
    time::Duration,
};

use gyre_client::{Manifest, RunError, Signals, log};
use gyre_contract::{run::LinkConfig, topic};
use gyre_journal::Journal;
use gyre_supervise::rig::Rig;
use zenoh::{Session, Wait};

use crate::{
    error::other_version,
    request::Question,
    send::{OfferedTopic, RunOffer, began_ns, is_lossless, offer_key},
    session,
    waker::Waker,
};

use mirror::Mirror;

const NAME: &str = "link";
const PAUSE: Duration = Duration::from_millis(200);

const ASK_FOR_RUN: Question = Question("ask for a run", "the sender");

#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Received {
    pub topics: BTreeMap<String, ReceivedCount>,
    /// True if it ended on a request to stop, before the run.
    pub is_interrupted: bool,
}

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct ReceivedCount {
    pub received: u64,
    pub missed: u64,
}

impl Received {
    pub fn is_complete(&self) -> bool {
        let mut topics = self.topics.iter();
        topics.all(|(topic, count)| !is_lossless(topic) || count.missed == 0)
    }
}

impl fmt::Display for Received {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let list = |number: fn(&ReceivedCount) -> u64| {
            let topics = self.topics.iter().filter(|it| number(it.1) > 0);
            let topics = topics.map(|(topic, count)| format!("{} {topic}", number(count)));
            match &topics.collect::<Vec<String>>()[..] {
                [] => "nothing".to_owned(),
                topics => topics.join(", "),
            }
        };
        let (received, missed) = (list(|it| it.received), list(|it| it.missed));
        write!(f, "received {received}; missed {missed}")
    }
}

pub struct RemoteRun {
    session: Session,
    offer: RunOffer,
}

/// Waits for the sender. `None` on a request to stop.
pub fn ask(link: &LinkConfig, signals: &Signals) -> Result<Option<RemoteRun>, RunError> {
    let Some(session) = session::open(link, || signals.sleep(PAUSE))? else {
        return Ok(None);
    };
    loop {
        let key = offer_key(&link.name);
        if let Some(offer) = ASK_FOR_RUN.ask::<RunOffer>(&session, key, [])? {
            offer.topics.iter().try_for_each(require_same)?;
            return Ok(Some(RemoteRun { session, offer }));
        }
        if signals.sleep(PAUSE)? {
            return Ok(None);
        }
    }
}

fn require_same(offered: &OfferedTopic) -> Result<(), RunError> {
    let ours = topic(&offered.name).map(|topic| topic.header.name);
    match ours == Some(&*offered.version) {
        true => Ok(()),
        false => Err(other_version(ASK_FOR_RUN.1)),
    }
}

impl RemoteRun {
    pub fn manifest(&self, out: &Path) -> Manifest {
        let offer = &self.offer;
        Manifest {
            prefix: String::new(),
            root: PathBuf::new(),
            out: out.to_owned(),
            window: offer.window,
            limits: offer.limits,
            live: offer.live,
            refines: offer.refines,
            rate: offer.rate,
            build: String::new(),
        }
    }
}

/// Receives these topics of those that are sent; without any all. `gyre` is the program.
pub fn receive(
    out: &Path,
    link: &LinkConfig,
    topics: &[String],
    gyre: String,
    remote: RemoteRun,
    signals: &Signals,
) -> Result<Received, RunError> {
    let manifest = remote.manifest(out);
    let mut journal = Journal::open(&manifest.out).map_err(RunError::input)?;
    let next_pose = next_pose(&mut journal, &remote.offer, out)?;
    let guardian = [gyre, "guard".to_owned()];
    let rig = Rig::new(manifest, &remote.offer.configuration, &guardian, signals);
    let mut rig = rig.map_err(RunError::input)?;
    rig.create_services().map_err(RunError::input)?;
    let _log = log::start_log(rig.manifest(), NAME)?;
    let RemoteRun { session, offer } = remote;
    let mut mirror = Mirror {
        session: session.clone(),
        link: link.name.clone(),
        receiver: receiver(out, &session)?,
        topics: Vec::new(),
        journal,
        next_pose,
        offer,
        waker: Waker::new()?,
        signals,
        rig,
    };
    for offered in mirror.offer.topics.clone() {
        if topics.is_empty() || topics.contains(&offered.name) {
            mirror.topics.push(mirror.open(&offered)?);
        }
    }
    let received = mirror.run();
    // All at the same time: each may wait for a sender that does not answer.
    let topics = mirror.topics;
    topics.iter().for_each(|it| it.fetcher.begin_to_leave());
    topics.into_iter().for_each(|it| it.fetcher.leave());
    let _ = session.close().wait();
    received
}

/// Returns the identity of this receiver, the same after a restart: the name of the first session
/// that has written to the folder.
fn receiver(out: &Path, session: &Session) -> Result<String, RunError> {
    let path = out.join("journal/receiver");
    match fs::read_to_string(&path) {
        Ok(name) if !name.is_empty() && name.chars().all(|c| c.is_ascii_hexdigit()) => Ok(name),
        Err(source) if source.kind() != ErrorKind::NotFound => Err(RunError::File { path, source }),
        _ => {
            let name = session.zid().to_string();
            fs::write(&path, &name).map_err(|source| RunError::File { path, source })?;
            Ok(name)
        }
    }
}

fn next_pose(journal: &mut Journal, offer: &RunOffer, out: &Path) -> Result<u64, RunError> {
    let (last, ended) = journal.last(1).map_err(RunError::input)?;
    let Some(last) = last.first() else {
        return Ok(0);
    };
    match began_ns(out)? == offer.began_ns && !ended {
        true => Ok(last.item.seq.saturating_add(1)),
        false => Err(RunError::Input(format!(
            "{} has the poses of a different drive: choose another folder",
            out.display()
        ))),
    }
}
