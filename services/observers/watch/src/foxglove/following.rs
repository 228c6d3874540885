//! The threads that observe the topics that viewers want.

use std::{
    io,
    path::PathBuf,
    sync::Arc,
    thread::{self, JoinHandle},
    time::{Duration, Instant},
};

use bytemuck::bytes_of;
use gyre_messages::{
    Correction, Fix, Loop, Masked, Message, Motion, Objects, Pose, Refined, Rotation, Scan,
};
use gyre_recording::{
    LogTail,
    view::{LOG, POINTS, TRAJECTORY, View, views},
};
use gyre_stage::{
    StageError, clock,
    observer::{Next, ObservedRun, Observer},
    reader::Received,
};

use super::{
    Hub,
    measurements::{HEALTH, LATENCY, latency},
};
use crate::{messages::RunState, observing::Followed};

/// Time between two polls for a run, for viewers that want a topic, and for a request to stop.
const POLL_INTERVAL: Duration = Duration::from_millis(200);
/// The shortest time between two pictures of a topic, for recordings that are played fast.
const PICTURE_INTERVAL: Duration = Duration::from_millis(50);

/// The shortest time between two complete trajectories.
const TRAJECTORY_INTERVAL: Duration = Duration::from_secs(1);

/// A topic that is published to viewers.
struct FollowedTopic<M: Message> {
    hub: Arc<Hub>,
    followed: Arc<Followed>,
    /// Publishes the views that need the payload.
    more: fn(&mut FollowedTopic<M>, &Received<M>),
    /// When the last picture or trajectory was made.
    drawn: Option<Instant>,
}

/// Starts the threads. They end when the view is stopped.
pub fn start(followed: &Arc<Followed>, hub: &Arc<Hub>) -> io::Result<Vec<JoinHandle<()>>> {
    let report = {
        let (followed, hub) = (Arc::clone(followed), Arc::clone(hub));
        let thread = thread::Builder::new().name("foxglove".to_owned());
        thread.spawn(move || report(&followed, &hub))?
    };
    Ok(vec![
        report,
        follow::<Scan>(followed, hub, picture)?,
        follow::<Masked>(followed, hub, masked)?,
        follow::<Rotation>(followed, hub, nothing)?,
        follow::<Motion>(followed, hub, nothing)?,
        follow::<Refined>(followed, hub, nothing)?,
        follow::<Pose>(followed, hub, pose)?,
        follow::<Loop>(followed, hub, nothing)?,
        follow::<Correction>(followed, hub, nothing)?,
        follow::<Fix>(followed, hub, nothing)?,
        follow::<Objects>(followed, hub, nothing)?,
    ])
}

fn follow<M: Message>(
    followed: &Arc<Followed>,
    hub: &Arc<Hub>,
    more: fn(&mut FollowedTopic<M>, &Received<M>),
) -> io::Result<JoinHandle<()>> {
    let mut topic = FollowedTopic {
        hub: Arc::clone(hub),
        followed: Arc::clone(followed),
        more,
        drawn: None,
    };
    let thread = thread::Builder::new().name(format!("fox-{}", M::TOPIC));
    thread.spawn(move || topic.follow_runs())
}

impl<M: Message> FollowedTopic<M> {
    fn is_wanted(&self) -> bool {
        !self.followed.view.is_stopping() && self.hub.wants_topic(M::TOPIC)
    }

    fn follow_runs(&mut self) {
        while !self.followed.view.is_stopping() {
            thread::sleep(POLL_INTERVAL);
            if !self.is_wanted() || self.followed.view.run().state != RunState::Working {
                continue;
            }
            match ObservedRun::writing_to(&self.followed.out).and_then(|run| self.follow(&run)) {
                Ok(()) | Err(StageError::NotRunning { .. }) => {}
                Err(error) => {
                    let notice = format!("{} is not shown: {error}.", M::TOPIC);
                    self.hub.notice.send_replace(notice);
                }
            }
        }
    }

    /// Follows a run as long as a viewer wants the topic.
    fn follow(&mut self, run: &ObservedRun) -> Result<(), StageError> {
        let mut observer: Observer<'_, M> = run.observe()?;
        self.drawn = None;
        while self.is_wanted() {
            match observer.next(POLL_INTERVAL)? {
                Next::Message(message, _) => {
                    let stamp_ns = message.item().stamp_ns;
                    for view in views(M::TOPIC, bytes_of(message.header())) {
                        self.hub.publish(view.channel, stamp_ns, view.data);
                    }
                    (self.more)(self, message);
                }
                Next::Idle => {}
                Next::Ended => break,
            }
        }
        Ok(())
    }

    /// Publishes a view if it is wanted. A message that is too short for its header has none.
    fn publish(&self, channel: &str, stamp_ns: i64, view: impl FnOnce() -> Option<View>) {
        if self.hub.is_wanted(channel)
            && let Some(view) = view()
        {
            self.hub.publish(channel, stamp_ns, view.data);
        }
    }

    /// Returns whether another picture is due.
    fn is_due(&mut self, interval: Duration) -> bool {
        let is_due = self.drawn.is_none_or(|drawn| drawn.elapsed() >= interval);
        if is_due {
            self.drawn = Some(Instant::now());
        }
        is_due
    }
}

fn nothing<M: Message>(_: &mut FollowedTopic<M>, _: &Received<M>) {}

fn picture(topic: &mut FollowedTopic<Scan>, message: &Received<Scan>) {
    if topic.is_due(PICTURE_INTERVAL) {
        image(topic, "/scan", message);
    }
}

fn masked(topic: &mut FollowedTopic<Masked>, message: &Received<Masked>) {
    if !topic.is_due(PICTURE_INTERVAL) {
        return;
    }
    image(topic, "/masked", message);
    let header = message.header();
    topic.publish(POINTS, header.item.stamp_ns, || {
        let points = header.points(message.values())?;
        Some(View::points(points, header))
    });
}

fn image<M: Message>(topic: &FollowedTopic<M>, channel: &str, message: &Received<M>) {
    let stamp_ns = message.item().stamp_ns;
    topic.publish(channel, stamp_ns, || {
        let header = bytes_of(message.header());
        View::image_of(M::TOPIC, header, message.values(), stamp_ns)
    });
}

fn pose(topic: &mut FollowedTopic<Pose>, message: &Received<Pose>) {
    let item = message.item();
    let stamp_ns = item.stamp_ns;
    if topic.hub.is_wanted(LATENCY) {
        topic.hub.publish(LATENCY, stamp_ns, latency(item));
    }
    if topic.hub.is_wanted(TRAJECTORY) && topic.is_due(TRAJECTORY_INTERVAL) {
        let poses = topic.followed.view.trajectory();
        let view = View::trajectory(poses.into_iter(), stamp_ns);
        topic.hub.publish(TRAJECTORY, stamp_ns, view.data);
    }
}

/// Publishes the log of the run and the report of each second, and announces the channels of a run.
fn report(followed: &Followed, hub: &Hub) {
    let view = &followed.view;
    let mut health = view.updates.health.subscribe();
    let mut run = String::new();
    let (mut path, mut log) = (None, None);
    while !view.is_stopping() {
        thread::sleep(POLL_INTERVAL);
        let current = view.run().id;
        if current != run {
            (run, log) = (current, None);
            path = announce(followed, hub);
        }
        if !hub.is_wanted(LOG) {
            log = None;
        }
        // Before the first pose there is no time of the sensor for the messages.
        let Some(stamp_ns) = view.newest_stamp_ns() else {
            continue;
        };
        if hub.is_wanted(LOG)
            && let Some(path) = &path
        {
            let log = log.get_or_insert_with(|| LogTail::new(path));
            for line in log.lines(clock::since_1970_ns()) {
                hub.publish(LOG, stamp_ns, View::log(&line).data);
            }
        }
        if health.has_changed().unwrap_or(false) {
            let report = health.borrow_and_update().as_bytes().to_vec();
            hub.publish(HEALTH, stamp_ns, report);
        }
    }
}

/// Announces the channels of the run, and returns the path of its log.
fn announce(followed: &Followed, hub: &Hub) -> Option<PathBuf> {
    let run = ObservedRun::writing_to(&followed.out).ok()?;
    let channels = hub.channels.iter().enumerate();
    let of_run = channels.filter(|(_, channel)| channel.is_of(run.manifest()));
    hub.of_run.send_replace(of_run.map(|(id, _)| id).collect());
    Some(run.manifest().events())
}
