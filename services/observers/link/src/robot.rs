//! The robot's side of a split run, in the place of the last stages.
//!
//! It journals the poses that come back as pose-integration does, so this side has all results too,
//! and continues after a restart. It begins when the base has named the items that will have poses:
//! only then does it publish the newest pose, where the source continues.

use std::{collections::VecDeque, sync::Arc, thread};

use bytemuck::Pod;
use gyre_client::{RunError, clock};
use gyre_contract::{
    Hop, Item, Masked, Message as _, Motion, MotionHeader, Pose, PoseHeader, StageId, flag,
    run::{LinkConfig, PlayedFrom, Side, StageCounters},
};
use gyre_journal::Journal;
use gyre_stage::{Launch, relay::LastStages};
use zenoh::{Session, Wait, qos::Priority};

use crate::{
    connection_log::ConnectionLog,
    fetch::{Fetcher, Request},
    handshake::{self, Agreement, StartAnswer},
    replay_buffer::{MemoryBuffer, ReplayBuffer},
    request,
    serve::{LAST_ANSWERS, Offer, Server},
    session,
    waker::Waker,
};

pub fn run(launch: &Launch) -> Result<StageCounters, RunError> {
    launch.take_place()?;
    let config: LinkConfig = launch.section("link")?;
    let journal = Journal::open(&launch.manifest.out).map_err(RunError::input)?;
    let mut stages = LastStages::open(launch, config.returns_motions())?;
    let waker = Waker::new()?;
    let sleep = || stages.sleep(waker.descriptor());
    let Some(session) = session::open(&config, sleep)? else {
        return Ok(stages.counters());
    };
    let mut robot = Robot {
        launch,
        stages,
        journal,
        next_pose: 0,
        sent: VecDeque::new(),
        session,
        waker,
        config,
    };
    let worked = robot.work();
    let _ = robot.session.close().wait();
    worked?;
    Ok(robot.stages.counters())
}

struct Robot<'a> {
    launch: &'a Launch,
    config: LinkConfig,
    stages: LastStages<'a>,
    journal: Journal,
    /// The number of the first pose that is not in the journal.
    next_pose: u64,
    /// The newest items of the cut, with their times on this machine.
    sent: VecDeque<Item>,
    session: Session,
    waker: Waker,
}

struct SentTopic {
    buffer: Arc<MemoryBuffer>,
    offer: Arc<Offer>,
}

impl Robot<'_> {
    fn work(&mut self) -> Result<(), RunError> {
        let bytes = self.launch.manifest.limits.scan_bytes;
        let key = handshake::scan_size_key(&self.config);
        let _scan_size = request::answer(
            &self.session,
            key,
            "report the size of the scans",
            move || bytes,
        )?;
        let (poses, ended) = self.last_poses()?;
        let newest = poses.last().map(|pose| pose.item);
        if ended {
            // The run has ended before, and only its results are missing.
            self.stages.republish(&poses)?;
            self.stages.end(newest.unwrap_or_default())?;
            while !self.sleep()? {}
            return Ok(());
        }
        self.next_pose = newest.map_or(0, |item| item.seq.saturating_add(1));
        let Some(received) = self.begin()? else {
            return Ok(());
        };
        let poses = self.fetch(Pose::TOPIC);
        if !self.catch_up(&poses, received)? {
            return Ok(());
        }
        let (last, _) = self.last_poses()?;
        self.stages.republish(&last)?;
        self.stages.has_handed_over(0)?;
        self.relay(&poses)
    }

    /// Returns the newest poses of the journal, to be published again, and whether it has ended.
    fn last_poses(&mut self) -> Result<(Vec<PoseHeader>, bool), RunError> {
        let poses = self.journal.last(self.stages.history().max(1));
        poses.map_err(RunError::input)
    }

    /// Asks the base where to continue until it answers; returns the number of items that have
    /// poses or will. `None` on a request to stop.
    fn begin(&mut self) -> Result<Option<u64>, RunError> {
        let topics = self.topics();
        let agreement = Agreement::of(&self.launch.manifest, &self.config, &topics);
        let mut logged = String::new();
        loop {
            let waits = match handshake::ask_base(&self.session, &self.config, &agreement)? {
                Some(StartAnswer::Go(newest)) => {
                    let received = newest.map_or(0, |newest| newest + 1);
                    return self.check_start(received).map(|()| Some(received));
                }
                Some(StartAnswer::Refused(why)) => return Err(RunError::Input(why)),
                Some(StartAnswer::Wait(why)) => why,
                None => "the base does not answer yet".to_owned(),
            };
            if waits != logged {
                tracing::info!("waiting: {waits}");
                logged = waits;
            }
            if self.sleep()? {
                return Ok(None);
            }
        }
    }

    fn check_start(&self, received: u64) -> Result<(), RunError> {
        let (poses, base) = (self.next_pose, received);
        let window = self.launch.manifest.window.scans as u64;
        match self.config.cut {
            _ if base < poses => Err(RunError::Input(format!(
                "this run has {poses} poses, but the base begins at {base}: start both again with --fresh, or continue with the base's --out of this run"
            ))),
            // The local map is here, and cannot be restored from poses.
            PlayedFrom::Refined if base > poses.saturating_add(window) => {
                Err(RunError::Input(format!(
                    "the base has {base} poses and this run {poses}, and the local map of the refinement, which is here, cannot be made up: start both again with --fresh"
                )))
            }
            _ => Ok(()),
        }
    }

    /// Journals the poses of all items of an earlier start; false on a request to stop.
    fn catch_up(&mut self, poses: &Fetcher, received: u64) -> Result<bool, RunError> {
        while self.next_pose < received {
            self.waker.clear();
            while let Some(bytes) = poses.next() {
                self.journal(&bytes)?;
            }
            if self.next_pose < received && self.sleep()? {
                return Ok(false);
            }
        }
        Ok(true)
    }

    /// Sends the messages of the stages here, and publishes those that come back, until SIGTERM.
    fn relay(&mut self, poses: &Fetcher) -> Result<(), RunError> {
        let topics = self.topics();
        self.stages.read(&topics)?;
        let prefix = handshake::prefix(&self.config, Side::Robot);
        let mut server = Server::new(&self.session, &prefix, Some(self.waker.clone()));
        let depth = Masked::sizes(&self.launch.manifest.window).buffer;
        let sent = topics.iter().map(|topic| {
            let buffer = Arc::new(MemoryBuffer::of(depth));
            let offer = server.offer(topic, buffer.clone())?;
            Ok(SentTopic { buffer, offer })
        });
        let sent = sent.collect::<Result<Vec<_>, RunError>>()?;
        let returns_motions = self.config.returns_motions();
        let motions = returns_motions.then(|| self.fetch(Motion::TOPIC));
        let (mut end, mut has_ended) = (None, false);
        let mut connection = ConnectionLog::of("base");
        loop {
            self.waker.clear();
            for (place, sent) in sent.iter().enumerate() {
                end = self.send(place, sent, topics.len(), depth)?.or(end);
            }
            while let Some(bytes) = motions.as_ref().and_then(Fetcher::next) {
                let motion = self.checked::<Motion, MotionHeader>(&bytes)?;
                self.stages.publish_motion(motion)?;
            }
            while let Some(bytes) = poses.next() {
                if let Some(pose) = self.journal(&bytes)? {
                    self.stages.publish_pose(pose)?;
                }
            }
            connection.update(poses.is_connected(), self.next_pose);
            if let Some(end) = end.filter(|end| !has_ended && self.next_pose == end.seq) {
                has_ended = self.end(&end, &sent, poses)?;
            }
            if self.sleep()? {
                if has_ended {
                    thread::sleep(LAST_ANSWERS);
                }
                return Ok(());
            }
        }
    }

    /// Buffers the messages of a topic for the base; returns the item of the end, if it is there.
    fn send(
        &mut self,
        place: usize,
        sent: &SentTopic,
        topics: usize,
        depth: usize,
    ) -> Result<Option<Item>, RunError> {
        let mut end = None;
        while let Some(message) = self.stages.receive(place)? {
            let item = message.item().unwrap_or_default();
            // The cut is the last of the topics: with it all of a scan is on its way.
            if place + 1 == topics {
                self.sent.push_back(item);
                self.sent.drain(..self.sent.len().saturating_sub(depth));
                self.stages
                    .has_handed_over(item.published.saturating_add(1))?;
                end = item.is(flag::END).then_some(item);
            }
            sent.buffer.add(&message);
        }
        Ok(end)
    }

    /// Journals a pose; `None` if it was there already.
    fn journal(&mut self, bytes: &[u8]) -> Result<Option<PoseHeader>, RunError> {
        let mut pose = self.checked::<Pose, PoseHeader>(bytes)?;
        let (expected, got) = (self.next_pose, pose.item.seq);
        if got < expected || pose.item.is(flag::END) {
            return Ok(None);
        }
        if got > expected {
            return Err(RunError::gap(Pose::TOPIC, expected, got));
        }
        pose.item = self.timed(pose.item);
        self.journal.append(&pose).map_err(RunError::input)?;
        self.next_pose = got.saturating_add(1);
        Ok(Some(pose))
    }

    /// Returns the item of a pose with the times on this machine's clock: the work of the base
    /// counts as part of the last stage here.
    fn timed(&self, item: Item) -> Item {
        let now_ns = clock::now_ns();
        let sent = self.sent.iter().find(|sent| sent.seq == item.seq);
        let unknown = Item {
            hops: Default::default(),
            due_ns: now_ns,
            ..item
        };
        let mut timed = sent.copied().unwrap_or(unknown);
        let handed_over_ns = timed.hops.iter().map(|hop| hop.published_ns).max();
        let received_ns = handed_over_ns.filter(|ns| *ns > 0).unwrap_or(now_ns);
        *timed.hop_mut(StageId::PoseIntegration) = Hop {
            received_ns,
            started_ns: received_ns,
            finished_ns: now_ns,
            published_ns: 0,
        };
        timed
    }

    /// Ends this side once the base requests what follows the end; false before.
    fn end(&mut self, end: &Item, sent: &[SentTopic], poses: &Fetcher) -> Result<bool, RunError> {
        // The base ends when it knows that all poses are here, and that this side knows of its end.
        poses.confirm(self.next_pose);
        let has_end = |sent: &SentTopic| sent.offer.answered() > end.seq;
        if !sent.iter().all(has_end) {
            return Ok(false);
        }
        let flags = flag::END;
        let end_record = PoseHeader {
            item: Item { flags, ..*end },
            ..PoseHeader::default()
        };
        self.journal.append(&end_record).map_err(RunError::input)?;
        self.stages.end(*end)?;
        Ok(true)
    }

    /// Returns the topics that cross the link, the cut last.
    fn topics(&self) -> Vec<&'static str> {
        let refines = self.launch.manifest.refines;
        self.config.cut.topics(refines, self.config.keyframes)
    }

    fn fetch(&self, topic: &str) -> Fetcher {
        let request = Request {
            key: format!("{}/{topic}", handshake::prefix(&self.config, Side::Base)),
            from: self.next_pose,
            generation: None,
            receiver: self.session.zid().to_string(),
            priority: Priority::InteractiveHigh,
        };
        Fetcher::start(&self.session, request, self.waker.clone())
    }

    /// Returns the header of a message from the network, if it is valid for its topic.
    fn checked<M: gyre_contract::Message<Header = H>, H: Pod>(
        &self,
        bytes: &[u8],
    ) -> Result<H, RunError> {
        let malformed = |reason: String| RunError::Malformed {
            topic: M::TOPIC,
            sender: "the base",
            seq: 0,
            reason,
        };
        let header: H = bytemuck::try_pod_read_unaligned(bytes)
            .map_err(|_| malformed(format!("{} bytes are no message", bytes.len())))?;
        M::check(&header, &[], &self.launch.manifest.limits)
            .map_err(|violation| malformed(violation.to_string()))?;
        Ok(header)
    }

    fn sleep(&mut self) -> Result<bool, RunError> {
        self.stages.sleep(self.waker.descriptor())
    }
}
