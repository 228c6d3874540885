//! The base's side of a split run: in the place of the source and the first stages, which the robot has.
//!
//! It publishes what the robot's stages have published, from the item of the newest pose on, and lets the robot have the poses, from the
//! journal, and the motions. The poses are the credit of the robot's source: while the link is cut, it stays away.

use std::{
    collections::VecDeque,
    sync::{
        Arc,
        mpsc::{Receiver, channel},
    },
    thread,
    time::{Duration, Instant},
};

use gyre_messages::{Item, Message as _, Motion, Pose, flag, topic};
use gyre_radar_replay::PlayedFrom;
use gyre_stage::{Launch, StageCounters, StageError, relay::FirstStages, source::RecordedMessage};
use zenoh::{
    Session, Wait,
    qos::Priority,
    query::{Query, Queryable},
};

use crate::{
    LinkConfig, LinkError, Side,
    begin::{self, Agreement, Answer},
    fetch::{Fetcher, Request},
    serve::{Offer, Server},
    status::Status,
    tape::{Message, PoseLog, Poses, Ring},
    wake::Sleeper,
};

/// Time, when the run has ended, for the robot to learn that this side has all of it. After 2 s the supervisor ends this process.
const FAREWELL: Duration = Duration::from_millis(1500);
/// Time for the last answers to leave.
const LAST_ANSWERS: Duration = Duration::from_millis(300);
/// Time between two looks whether the robot knows.
const LOOK: Duration = Duration::from_millis(20);

/// Runs the base's side until SIGTERM.
///
/// # Errors
/// A robot of another run, or a failure of the transport.
pub fn run(launch: &Launch) -> Result<StageCounters, StageError> {
    if !launch.take_place()? {
        return Ok(StageCounters::default());
    }
    let config: LinkConfig = launch.section("link")?;
    let manifest = &launch.manifest;
    let topics = config.cut.topics(manifest.refines, manifest.window.slam);
    let mut stages = FirstStages::open(launch, &topics, config.returns_motions())?;
    let sleeper = Sleeper::new().map_err(|e| LinkError::zenoh("make a socket", &e))?;
    let sleep = || Ok(stages.sleep(sleeper.descriptor())?);
    let Some(session) = config.network().open(sleep)? else {
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
        sleeper,
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
    /// What crosses the link, the cut last.
    topics: Vec<&'static str>,
    stages: FirstStages<'a>,
    /// The newest item that was published here.
    published: Option<u64>,
    /// The newest pose when this process started.
    resumed: Item,
    /// The drive of the robot that was last let go on.
    drive: Option<String>,
    session: Session,
    sleeper: Sleeper,
}

/// What is offered to the robot.
struct PosesOnOffer {
    poses: Arc<Poses>,
    asked: Arc<Offer>,
    motions: Arc<Ring>,
    begins: Receiver<Query>,
    _begin: Queryable<()>,
    _server: Server,
}

/// A topic that comes from the robot.
struct Coming {
    fetcher: Fetcher,
    header_bytes: usize,
    messages: VecDeque<RecordedMessage>,
}

impl Base<'_> {
    fn work(&mut self) -> Result<(), LinkError> {
        let Some(start) = self.start()? else {
            return Ok(());
        };
        let offered = self.offer()?;
        let mut coming = self.fetch(start);
        let mut status = Status::of("robot");
        let mut end = None;
        loop {
            self.sleeper.clear();
            self.stages.update()?;
            self.give_back(&offered)?;
            for query in offered.begins.try_iter() {
                let others = coming.iter().any(|topic| topic.fetcher.is_connected());
                if self.answer(&query, others)? {
                    coming = self.fetch(self.published.map_or(start, |newest| newest + 1));
                }
            }
            coming.iter_mut().try_for_each(Coming::receive)?;
            while end.is_none() && self.publish(&mut coming, &offered, &mut end)? {}
            self.confirm(end.as_ref(), &coming);
            let is_connected = coming.iter().all(|topic| topic.fetcher.is_connected());
            status.update(is_connected, self.next());
            if self.stages.sleep(self.sleeper.descriptor())? {
                break;
            }
        }
        self.stages.update()?;
        if let Some(end) = end.filter(|_| self.stages.has_ended()) {
            self.say_farewell(&end, &coming);
        }
        Ok(())
    }

    /// Waits until the robot knows that all of the run is here, without which it would wait for that.
    fn say_farewell(&self, end: &Item, coming: &[Coming]) {
        let next = end.seq.saturating_add(1);
        let since = Instant::now();
        let is_confirmed = |topic: &Coming| topic.fetcher.is_confirmed(next);
        while !coming.iter().all(is_confirmed) {
            if since.elapsed() > FAREWELL {
                tracing::warn!(
                    "the robot is out of reach at the end, and waits for this side: it has all poses, and ends by Ctrl-C"
                );
                return;
            }
            self.confirm(Some(end), coming);
            thread::sleep(LOOK);
        }
        thread::sleep(LAST_ANSWERS);
    }

    /// Lets the robot know that this side has the end in its journal.
    fn confirm(&self, end: Option<&Item>, coming: &[Coming]) {
        if let Some(end) = end.filter(|_| self.stages.has_ended()) {
            let next = end.seq.saturating_add(1);
            coming.iter().for_each(|topic| topic.fetcher.confirm(next));
        }
    }

    /// Waits until pose-integration has told the newest pose; returns the first item that the stages need. `None` on a request to stop.
    fn start(&mut self) -> Result<Option<u64>, LinkError> {
        loop {
            // Sleep first, as the source of scans does.
            if self.stages.sleep(self.sleeper.descriptor())? {
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

    fn offer(&self) -> Result<PosesOnOffer, LinkError> {
        let manifest = &self.launch.manifest;
        let prefix = begin::prefix(&self.config, Side::Base);
        let mut server = Server::new(&self.session, &prefix, Some(self.sleeper.waker()));
        let poses = Arc::new(Poses::of(PoseLog::of(&manifest.out)));
        let motions = Arc::new(Ring::of(Motion::sizes(&manifest.window).buffer));
        let (sender, begins) = channel();
        let waker = self.sleeper.waker();
        let begin = self
            .session
            .declare_queryable(begin::key(&self.config))
            .callback(move |query| {
                let _ = sender.send(query);
                waker.wake();
            })
            .wait()
            .map_err(|e| LinkError::zenoh("wait for the robot", &e))?;
        let asked = server.offer(Pose::TOPIC, poses.clone())?;
        server.offer(Motion::TOPIC, motions.clone())?;
        Ok(PosesOnOffer {
            poses,
            asked,
            motions,
            begins,
            _begin: begin,
            _server: server,
        })
    }

    /// Asks the robot for all items from one on.
    fn fetch(&self, from: u64) -> Vec<Coming> {
        let prefix = begin::prefix(&self.config, Side::Robot);
        let coming = self.topics.iter().map(|name| {
            let request = Request {
                key: format!("{prefix}/{name}"),
                from,
                receiver: self.session.zid().to_string(),
                priority: Priority::Data,
            };
            Coming {
                fetcher: Fetcher::start(&self.session, request, self.sleeper.waker()),
                header_bytes: topic(name).map_or(0, |topic| topic.header.bytes),
                messages: VecDeque::new(),
            }
        });
        coming.collect()
    }

    /// Returns the number of the item that is published next.
    fn next(&self) -> u64 {
        let resumed = (!self.resumed.is(flag::BASE)).then_some(self.resumed.seq);
        let newest = self.published.or(resumed);
        newest.map_or(0, |newest| newest.saturating_add(1))
    }

    /// Offers the new poses and motions.
    fn give_back(&mut self, offered: &PosesOnOffer) -> Result<(), LinkError> {
        let resumed = (!self.resumed.is(flag::BASE)).then_some(self.resumed.seq);
        let newest = self.stages.newest_pose().max(resumed);
        offered
            .poses
            .have_come(newest.map_or(0, |newest| newest.saturating_add(1)));
        while let Some(motion) = self.stages.next_motion()? {
            offered.motions.push(Message::of(&motion));
        }
        Ok(())
    }

    /// Answers a robot that starts; true if it goes on from here.
    fn answer(&mut self, query: &Query, another_is_there: bool) -> Result<bool, LinkError> {
        let ours = Agreement::of(&self.launch.manifest, &self.config, &self.topics);
        let bytes = query
            .payload()
            .map(|payload| payload.to_bytes().into_owned());
        let theirs = serde_json::from_slice::<Agreement>(&bytes.unwrap_or_default());
        let drive = theirs.as_ref().ok().and_then(|theirs| theirs.drive.clone());
        let is_other = self.drive.is_some() && drive != self.drive && self.next() > 0;
        let answer = match theirs.map(|theirs| ours.difference(&theirs)) {
            Err(_) => Answer::Refused(
                "the base is another version of gyre: install the same on both".to_owned(),
            ),
            Ok(Some(difference)) => Answer::Refused(difference),
            Ok(None) if is_other => Answer::Refused(
                "the base has poses of another drive: begin both anew with --fresh".to_owned(),
            ),
            Ok(None) if another_is_there => Answer::Wait(
                "another robot is on this link, or was a moment ago: each has a name of its own (link.name)".to_owned(),
            ),
            Ok(None) => Answer::Go(self.next().checked_sub(1)),
        };
        if let Answer::Refused(why) = &answer {
            tracing::warn!("a robot was refused: {why}");
        }
        let text = serde_json::to_vec(&answer).map_err(|e| LinkError::zenoh("answer", &e))?;
        let replied = query.reply(begin::key(&self.config), text).wait();
        let goes_on = replied.is_ok() && matches!(answer, Answer::Go(_));
        if goes_on {
            self.drive = drive;
        }
        Ok(goes_on)
    }

    /// Publishes the next item if all of it has come; returns whether it has.
    fn publish(
        &mut self,
        coming: &mut [Coming],
        offered: &PosesOnOffer,
        end: &mut Option<Item>,
    ) -> Result<bool, LinkError> {
        let items = coming.iter().map(|topic| topic.messages.front()?.item());
        let Some(items) = items.collect::<Option<Vec<Item>>>() else {
            return Ok(false);
        };
        let Some(item) = items.iter().min_by_key(|item| item.seq).copied() else {
            return Ok(false);
        };
        self.judge(&item, &items)?;
        if item.is(flag::END) {
            // This side ends when the robot has all poses, and the robot when this side has journalled the end.
            if offered.asked.asked() < item.seq {
                return Ok(false);
            }
            self.stages.end(item)?;
            *end = Some(item);
            return Ok(true);
        }
        if !self.stages.admits(item.seq) {
            return Ok(false);
        }
        let messages: Vec<_> = coming
            .iter_mut()
            .map(|topic| topic.take(item.seq))
            .collect();
        self.stages.publish(&messages, item.seq)?;
        self.published = Some(item.seq);
        Ok(true)
    }

    /// Checks that the next item follows what was published, and is of the same drive. After a start it may be there to begin with alone, and
    /// then some of the topics need not have it.
    fn judge(&self, item: &Item, all: &[Item]) -> Result<(), LinkError> {
        let begins = self.published.is_none() && item.seq < self.next();
        let is_whole = all.iter().all(|other| other.seq == item.seq);
        let follows = is_whole && item.seq == self.next();
        if !begins && !follows {
            return Err(LinkError::Refused(format!(
                "the robot sends item {}, but this run needs {}, which the robot no longer has: begin both anew with --fresh",
                item.seq,
                self.next()
            )));
        }
        let is_resumed = item.seq == self.resumed.seq && !self.resumed.is(flag::BASE);
        match is_resumed && item.stamp_ns != self.resumed.stamp_ns {
            true => Err(LinkError::Refused(format!(
                "the robot's scan {} is not the one that this run has a pose of: it plays another drive; begin both anew with --fresh",
                item.scan
            ))),
            false => Ok(()),
        }
    }
}

impl Coming {
    /// Takes the message about an item, if it has come.
    fn take(&mut self, seq: u64) -> Option<RecordedMessage> {
        let first = self.messages.front()?.item();
        first
            .is_some_and(|it| it.seq == seq)
            .then(|| self.messages.pop_front())?
    }

    fn receive(&mut self) -> Result<(), LinkError> {
        while let Some(bytes) = self.fetcher.next() {
            let Some((header, payload)) = bytes.split_at_checked(self.header_bytes) else {
                let reason = format!("a message of {} bytes is too short", bytes.len());
                return Err(LinkError::Refused(reason));
            };
            self.messages.push_back(RecordedMessage {
                header: header.to_vec(),
                payload: payload.to_vec(),
            });
        }
        Ok(())
    }
}
