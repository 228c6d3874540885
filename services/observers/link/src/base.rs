//! The base's side of a split run, in the place of the source and the first stages.
//!
//! It publishes the messages of the robot's stages, from the item of the newest pose on, and sends
//! the poses, from the journal, and the motions to the robot. The poses are the credit of the
//! robot's source: while the link is cut, no credit arrives.

use std::{
    sync::{
        Arc,
        mpsc::{Receiver, channel},
    },
    thread,
    time::{Duration, Instant},
};

use gyre_client::{RecordedMessage, RunError};
use gyre_contract::{
    Item, Message as _, Motion, Pose, flag,
    run::{LinkConfig, PlayedFrom, Side, StageCounters},
    topic,
};
use gyre_stage::{Launch, relay::FirstStages};
use zenoh::{
    Session, Wait,
    qos::Priority,
    query::{Query, Queryable},
};

use crate::{
    connection_log::ConnectionLog,
    error::{failed, other_version},
    fetch::{Fetcher, Request},
    handshake::{self, Agreement, StartAnswer},
    replay_buffer::{LogBuffer, MemoryBuffer, ReplayBuffer},
    serve::{LAST_ANSWERS, Offer, Server},
    session,
    waker::Waker,
};

/// Time after which a message reports that the base is waiting for the robot at the end.
const QUIET: Duration = Duration::from_secs(1);
const POLL_INTERVAL: Duration = Duration::from_millis(20);

pub fn run(launch: &Launch) -> Result<StageCounters, RunError> {
    launch.take_place()?;
    let config: LinkConfig = launch.section("link")?;
    let manifest = &launch.manifest;
    let topics = config.cut.topics(manifest.refines, manifest.window.slam);
    let mut stages = FirstStages::open(launch, &topics, config.returns_motions())?;
    let waker = Waker::new()?;
    let sleep = || stages.sleep(waker.descriptor());
    let Some(session) = session::open(&config, sleep)? else {
        return Ok(stages.counters());
    };
    let mut base = Base {
        launch,
        stages,
        topics,
        config,
        published: None,
        resumed: Item::default(),
        drive: None,
        waker,
        session,
    };
    let worked = base.work();
    let _ = base.session.close().wait();
    worked?;
    Ok(base.stages.counters())
}

struct Base<'a> {
    launch: &'a Launch,
    config: LinkConfig,
    /// The topics that cross the link, the cut last.
    topics: Vec<&'static str>,
    stages: FirstStages<'a>,
    published: Option<u64>,
    resumed: Item,
    /// The drive of the robot that was admitted last.
    drive: Option<String>,
    session: Session,
    waker: Waker,
}

/// The topics that are offered to the robot, and its requests to start.
struct ToRobot {
    poses: Arc<LogBuffer>,
    pose_offer: Arc<Offer>,
    motions: Arc<MemoryBuffer>,
    starts: Receiver<Query>,
    _start: Queryable<()>,
    _server: Server,
}

struct FromRobot {
    fetcher: Fetcher,
    header_bytes: usize,
    next: Option<RecordedMessage>,
}

impl Base<'_> {
    fn work(&mut self) -> Result<(), RunError> {
        let Some(start) = self.start()? else {
            return Ok(());
        };
        let to_robot = self.offer()?;
        let mut topics = self.fetch(start);
        let mut connection = ConnectionLog::of("robot");
        let mut end = None;
        loop {
            self.waker.clear();
            self.stages.update()?;
            self.offer_new(&to_robot)?;
            for query in to_robot.starts.try_iter() {
                let others = topics.iter().any(|topic| topic.fetcher.is_connected());
                if self.answer(&query, others)? {
                    topics = self.fetch(self.published.map_or(start, |newest| newest + 1));
                }
            }
            while end.is_none() && self.publish(&mut topics, &to_robot, &mut end)? {}
            self.confirm(end.as_ref(), &topics);
            let is_connected = topics.iter().all(|topic| topic.fetcher.is_connected());
            connection.update(is_connected, self.next());
            if self.stages.sleep(self.waker.descriptor())? {
                break;
            }
        }
        self.stages.update()?;
        if let Some(end) = end.filter(|_| self.stages.has_ended()) {
            self.await_confirmation(&end, &topics);
        }
        Ok(())
    }

    /// Waits until the robot knows that all of the run is here: it waits for that to end.
    fn await_confirmation(&self, end: &Item, topics: &[FromRobot]) {
        let next = end.seq.saturating_add(1);
        let since = Instant::now();
        let is_confirmed = |topic: &FromRobot| topic.fetcher.is_confirmed(next);
        let mut is_said = false;
        while !topics.iter().all(is_confirmed) {
            if since.elapsed() > LinkConfig::END_TIMEOUT {
                tracing::warn!(
                    "the robot is out of reach at the end, and waits for this side: it has all poses, and ends by Ctrl-C"
                );
                return;
            }
            if since.elapsed() > QUIET && !is_said {
                tracing::info!("the robot is out of reach at the end, and is waited for");
                is_said = true;
            }
            self.confirm(Some(end), topics);
            thread::sleep(POLL_INTERVAL);
        }
        thread::sleep(LAST_ANSWERS);
    }

    fn confirm(&self, end: Option<&Item>, topics: &[FromRobot]) {
        if let Some(end) = end.filter(|_| self.stages.has_ended()) {
            let next = end.seq.saturating_add(1);
            topics.iter().for_each(|topic| topic.fetcher.confirm(next));
        }
    }

    /// Waits until pose-integration has published the newest pose; returns the first item that the
    /// stages need. `None` on a request to stop.
    fn start(&mut self) -> Result<Option<u64>, RunError> {
        loop {
            // Sleep first, as the source of scans does.
            if self.stages.sleep(self.waker.descriptor())? {
                return Ok(None);
            }
            self.stages.update()?;
            let Some(newest) = self.stages.resume_at().copied() else {
                continue;
            };
            self.resumed = newest;
            if newest.is(flag::BASE) {
                return Ok(Some(0));
            }
            // Masking may look back at one scan more than the stages after it.
            let window = &self.launch.manifest.window;
            let more = match self.config.cut {
                PlayedFrom::Scan if window.masks_pairs() && !newest.is(flag::BREAK) => 1,
                _ => 0,
            };
            return Ok(Some(newest.seq.saturating_sub(more)));
        }
    }

    fn offer(&self) -> Result<ToRobot, RunError> {
        let manifest = &self.launch.manifest;
        let prefix = handshake::prefix(&self.config, Side::Base);
        let mut server = Server::new(&self.session, &prefix, Some(self.waker.clone()));
        let poses = Arc::new(LogBuffer::of_poses(&manifest.out));
        let motions = Arc::new(MemoryBuffer::of(Motion::sizes(&manifest.window).buffer));
        let (sender, starts) = channel();
        let waker = self.waker.clone();
        let start = self
            .session
            .declare_queryable(handshake::start_key(&self.config))
            .callback(move |query| {
                let _ = sender.send(query);
                waker.wake();
            })
            .wait()
            .map_err(|e| failed("wait for the robot", &e))?;
        let pose_offer = server.offer(Pose::TOPIC, poses.clone())?;
        server.offer(Motion::TOPIC, motions.clone())?;
        Ok(ToRobot {
            poses,
            pose_offer,
            motions,
            starts,
            _start: start,
            _server: server,
        })
    }

    fn fetch(&self, from: u64) -> Vec<FromRobot> {
        let prefix = handshake::prefix(&self.config, Side::Robot);
        let topics = self.topics.iter().map(|name| {
            let request = Request {
                key: format!("{prefix}/{name}"),
                from,
                generation: None,
                receiver: self.session.zid().to_string(),
                priority: Priority::Data,
            };
            FromRobot {
                fetcher: Fetcher::start(&self.session, request, self.waker.clone()),
                header_bytes: topic(name).map_or(0, |topic| topic.header.bytes),
                next: None,
            }
        });
        topics.collect()
    }

    fn next(&self) -> u64 {
        let newest = self.published.or(self.resumed_at());
        newest.map_or(0, |newest| newest.saturating_add(1))
    }

    /// Returns the number of the newest pose when this process started.
    fn resumed_at(&self) -> Option<u64> {
        (!self.resumed.is(flag::BASE)).then_some(self.resumed.seq)
    }

    fn offer_new(&mut self, to_robot: &ToRobot) -> Result<(), RunError> {
        let newest = self.stages.newest_pose().max(self.resumed_at());
        let published = newest.map_or(0, |newest| newest.saturating_add(1));
        to_robot.poses.set_published(published);
        while let Some(motion) = self.stages.next_motion()? {
            to_robot.motions.add(&motion);
        }
        Ok(())
    }

    /// Answers a robot that starts; true if it is admitted.
    fn answer(&mut self, query: &Query, another_is_there: bool) -> Result<bool, RunError> {
        let ours = Agreement::of(&self.launch.manifest, &self.config, &self.topics);
        let bytes = query.payload().map(|payload| payload.to_bytes());
        let theirs = serde_json::from_slice::<Agreement>(&bytes.unwrap_or_default());
        let drive = theirs.as_ref().ok().and_then(|theirs| theirs.drive.clone());
        let is_other = self.drive.is_some() && drive != self.drive && self.next() > 0;
        let answer = match theirs.map(|theirs| ours.difference(&theirs)) {
            Err(_) => StartAnswer::Refused(other_version("the base").to_string()),
            Ok(Some(difference)) => StartAnswer::Refused(difference),
            Ok(None) if is_other => StartAnswer::Refused(
                "the base has poses of a different drive: start both again with --fresh".to_owned(),
            ),
            Ok(None) if another_is_there => StartAnswer::Wait(
                "another robot is on this link, or was a moment ago: each has a name of its own (link.name)".to_owned(),
            ),
            Ok(None) => StartAnswer::Go(self.next().checked_sub(1)),
        };
        if let StartAnswer::Refused(why) = &answer {
            tracing::warn!("a robot was refused: {why}");
        }
        let text = serde_json::to_vec(&answer).map_err(|e| failed("answer", &e))?;
        let replied = query.reply(handshake::start_key(&self.config), text).wait();
        let is_admitted = replied.is_ok() && matches!(answer, StartAnswer::Go(_));
        if is_admitted {
            self.drive = drive;
        }
        Ok(is_admitted)
    }

    /// Publishes the next item if all of it has arrived; returns whether it has.
    fn publish(
        &mut self,
        topics: &mut [FromRobot],
        to_robot: &ToRobot,
        end: &mut Option<Item>,
    ) -> Result<bool, RunError> {
        topics.iter_mut().try_for_each(FromRobot::receive)?;
        let items = topics.iter().map(|topic| topic.next.as_ref()?.item());
        let Some(items) = items.collect::<Option<Vec<Item>>>() else {
            return Ok(false);
        };
        let Some(item) = items.iter().min_by_key(|item| item.seq).copied() else {
            return Ok(false);
        };
        self.check_next(&item, &items)?;
        if item.is(flag::END) {
            // The base ends after the robot has all poses, the robot after the base has the end.
            if to_robot.pose_offer.answered() < item.seq {
                return Ok(false);
            }
            self.stages.end(item)?;
            *end = Some(item);
            return Ok(true);
        }
        if !self.stages.admits(item.seq) {
            return Ok(false);
        }
        let messages = topics.iter_mut().map(|topic| topic.take(item.seq));
        self.stages
            .publish(&messages.collect::<Vec<_>>(), item.seq)?;
        self.published = Some(item.seq);
        Ok(true)
    }

    /// Checks that the next item follows the published ones, and is of the same drive. After a
    /// start some topics may lack an item that was published before.
    fn check_next(&self, item: &Item, all: &[Item]) -> Result<(), RunError> {
        let begins = self.published.is_none() && item.seq < self.next();
        let is_whole = all.iter().all(|other| other.seq == item.seq);
        let follows = is_whole && item.seq == self.next();
        if !begins && !follows {
            return Err(RunError::Input(format!(
                "the robot sends item {}, but this run needs {}, which the robot no longer has: start both again with --fresh",
                item.seq,
                self.next()
            )));
        }
        let is_resumed = self.resumed_at() == Some(item.seq);
        match is_resumed && item.stamp_ns != self.resumed.stamp_ns {
            true => Err(RunError::Input(format!(
                "the robot's scan {} is not the one that this run has a pose of: it plays a different drive; start both again with --fresh",
                item.scan
            ))),
            false => Ok(()),
        }
    }
}

impl FromRobot {
    fn take(&mut self, seq: u64) -> Option<RecordedMessage> {
        let is_next = |next: &mut RecordedMessage| next.item().is_some_and(|it| it.seq == seq);
        self.next.take_if(is_next)
    }

    fn receive(&mut self) -> Result<(), RunError> {
        if self.next.is_none() {
            self.next = self.fetcher.next_with_payload(self.header_bytes)?;
        }
        Ok(())
    }
}
