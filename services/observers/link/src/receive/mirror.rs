//! The copy of a run of another machine.

use gyre_client::{MAX_WAIT, RecordedMessage, RunError, Signals, TopicWriter, observer::Sequence};
use gyre_contract::{Limits, Message as _, Pose, PoseHeader, Use, flag, topic};
use gyre_journal::Journal;
use gyre_supervise::rig::Rig;
use zenoh::{Session, qos::Priority};

use super::{ASK_FOR_RUN, Received, ReceivedCount, require_same};
use crate::{
    connection_log::ConnectionLog,
    error::other_version,
    fetch::{Fetcher, Request},
    send::{OfferedTopic, RunOffer, began_ns, is_lossless, offer_key, prefix},
    waker::Waker,
};

pub(super) struct Mirror<'a> {
    pub session: Session,
    pub link: String,
    pub receiver: String,
    pub offer: RunOffer,
    pub topics: Vec<MirroredTopic>,
    /// The poses that have arrived: they are not requested again.
    pub journal: Journal,
    pub next_pose: u64,
    pub waker: Waker,
    pub signals: &'a Signals,
    pub rig: Rig<'a>,
}

pub(super) struct MirroredTopic {
    name: &'static str,
    header_bytes: usize,
    pub fetcher: Fetcher,
    feed: TopicWriter,
    sequence: Sequence,
    received: u64,
}

impl Mirror<'_> {
    pub fn open(&self, offered: &OfferedTopic) -> Result<MirroredTopic, RunError> {
        let topic = topic(&offered.name).ok_or_else(|| other_version(ASK_FOR_RUN.1))?;
        let sequence = Sequence::default();
        Ok(MirroredTopic {
            name: topic.name,
            header_bytes: topic.header.bytes,
            fetcher: self.fetch(topic.name, &sequence),
            feed: self.rig.feed(topic.name)?,
            sequence,
            received: 0,
        })
    }

    /// Requests the messages of a topic behind those that are here, and messages of later
    /// generations.
    fn fetch(&self, topic: &str, here: &Sequence) -> Fetcher {
        let from = match topic {
            Pose::TOPIC => self.next_pose,
            _ => here.next.unwrap_or_default(),
        };
        let request = Request {
            key: format!("{}/{topic}", prefix(&self.link, &self.offer.sender)),
            from,
            generation: Some(here.generation),
            receiver: self.receiver.clone(),
            // A scan takes long: poses go before it.
            priority: match is_lossless(topic) {
                true => Priority::InteractiveHigh,
                false => Priority::DataLow,
            },
        };
        Fetcher::start(&self.session, request, self.waker.clone())
    }

    /// Asks for another sender, and continues with it if it sends the same drive.
    fn find_another_sender(&mut self) -> Result<(), RunError> {
        match ASK_FOR_RUN.ask(&self.session, offer_key(&self.link), [])? {
            Some(offer) => self.continue_with(offer),
            None => Ok(()),
        }
    }

    fn continue_with(&mut self, other: RunOffer) -> Result<(), RunError> {
        if other.sender == self.offer.sender {
            return Ok(());
        }
        other.topics.iter().try_for_each(require_same)?;
        if !self.is_same_drive(&other)? {
            return Err(RunError::Input(
                "the sender plays a different drive now: what arrived of this drive is whole up to here; receive the new drive into a different folder".to_owned(),
            ));
        }
        let is_sent = |topic: &MirroredTopic| other.topics.iter().any(|it| it.name == topic.name);
        if let Some(topic) = self.topics.iter().find(|topic| !is_sent(topic)) {
            return Err(RunError::Input(format!(
                "the sender has begun again and does not send `{}` any more: give it the same --topics",
                topic.name
            )));
        }
        self.offer = other;
        for place in 0..self.topics.len() {
            let topic = &self.topics[place];
            if !topic.fetcher.has_ended() {
                self.topics[place].fetcher = self.fetch(topic.name, &topic.sequence);
            }
        }
        Ok(())
    }

    fn is_same_drive(&self, other: &RunOffer) -> Result<bool, RunError> {
        let properties = |of: &RunOffer| (of.window, of.limits, of.live, of.refines);
        let began_ns = match self.next_pose {
            0 => self.offer.began_ns,
            _ => began_ns(&self.rig.manifest().out)?,
        };
        let continues = match began_ns {
            Some(_) => other.began_ns == began_ns,
            // Without a pose of the drive nothing of it may be there.
            None => self.topics.iter().all(|it| it.sequence.next.is_none()),
        };
        Ok(properties(&self.offer) == properties(other) && continues)
    }

    /// Publishes the messages that arrive until all topics have ended, or a signal arrives.
    pub fn run(&mut self) -> Result<Received, RunError> {
        let mut connection = ConnectionLog::of("sender");
        let limits = self.rig.manifest().limits;
        loop {
            self.waker.clear();
            let have_ended = self.topics.iter().all(|topic| topic.fetcher.has_ended());
            for topic in &mut self.topics {
                while let Some(message) = topic.next_message()? {
                    if topic.name == Pose::TOPIC {
                        self.next_pose =
                            append(&mut self.journal, &message, self.next_pose, &limits)?;
                    }
                    topic
                        .feed
                        .send_unchanged(&message.header, &message.payload)?;
                }
            }
            if have_ended {
                return Ok(self.received(false));
            }
            let is_live =
                |topic: &MirroredTopic| topic.fetcher.is_connected() && !topic.fetcher.has_ended();
            let is_connected = self.topics.iter().any(is_live);
            connection.update(is_connected, self.next_pose);
            if !is_connected {
                self.find_another_sender()?;
            }
            for topic in &self.topics {
                topic.feed.answer_handshakes()?;
            }
            let readers = self.topics.iter().map(|topic| topic.feed.listener());
            let readers: Vec<_> = readers.collect();
            let descriptor = Some(self.waker.descriptor());
            let signals = self.signals;
            let woken = signals.wait_or_readable(&[], &readers, descriptor, MAX_WAIT)?;
            if woken.stop {
                return Ok(self.received(true));
            }
        }
    }

    fn received(&self, is_interrupted: bool) -> Received {
        let counts = self.topics.iter().map(|topic| {
            let replaces = gyre_contract::topic(topic.name).is_some_and(|it| it.is(Use::Replaces));
            let missed = match replaces {
                true => 0,
                false => topic.sequence.missed,
            };
            let received = topic.received;
            (topic.name.to_owned(), ReceivedCount { received, missed })
        });
        Received {
            is_interrupted,
            topics: counts.collect(),
        }
    }
}

impl MirroredTopic {
    /// Returns the next message that has arrived, and counts it.
    fn next_message(&mut self) -> Result<Option<RecordedMessage>, RunError> {
        let Some(message) = self.fetcher.next_with_payload(self.header_bytes)? else {
            return Ok(None);
        };
        self.received += 1;
        if let Some(item) = message.item() {
            self.sequence.advance(&item);
        }
        Ok(Some(message))
    }
}

fn append(
    journal: &mut Journal,
    message: &RecordedMessage,
    next: u64,
    limits: &Limits,
) -> Result<u64, RunError> {
    let pose: Option<PoseHeader> = bytemuck::try_pod_read_unaligned(&message.header).ok();
    let is_new = |pose: &PoseHeader| {
        pose.item.seq == next && !pose.item.is(flag::END) && Pose::check(pose, &[], limits).is_ok()
    };
    let Some(pose) = pose.filter(is_new) else {
        return Ok(next);
    };
    journal.append(&pose).map_err(RunError::input)?;
    Ok(next + 1)
}
