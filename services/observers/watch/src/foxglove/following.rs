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
use gyre_stage::{clock, observer::ObservedRun, reader::Received};

use super::{
    Hub,
    measurements::{HEALTH, LATENCY, latency},
};
use crate::observing::{Followed, follow_topic};

/// Time between two polls for the log and the report, and for a request to stop.
const POLL_INTERVAL: Duration = Duration::from_millis(200);
/// The shortest time between two pictures of a topic, for recordings that are played fast.
const PICTURE_INTERVAL: Duration = Duration::from_millis(50);

const TRAJECTORY_INTERVAL: Duration = Duration::from_secs(1);

struct Publisher {
    hub: Arc<Hub>,
    followed: Arc<Followed>,
    /// When the last picture or trajectory was made.
    drawn: Option<Instant>,
}

pub fn start(followed: &Arc<Followed>, hub: &Arc<Hub>) -> io::Result<Vec<JoinHandle<()>>> {
    let report = {
        let (followed, hub) = (Arc::clone(followed), Arc::clone(hub));
        let thread = thread::Builder::new().name("foxglove".to_owned());
        thread.spawn(move || report(&followed, &hub))?
    };
    Ok(vec![
        report,
        follow::<Scan>(followed, hub, Publisher::scan)?,
        follow::<Masked>(followed, hub, Publisher::masked)?,
        follow::<Rotation>(followed, hub, |_, _| {})?,
        follow::<Motion>(followed, hub, |_, _| {})?,
        follow::<Refined>(followed, hub, |_, _| {})?,
        follow::<Pose>(followed, hub, Publisher::pose)?,
        follow::<Loop>(followed, hub, |_, _| {})?,
        follow::<Correction>(followed, hub, |_, _| {})?,
        follow::<Fix>(followed, hub, |_, _| {})?,
        follow::<Objects>(followed, hub, |_, _| {})?,
    ])
}

/// Follows a topic; `more` publishes the views that need the payload.
fn follow<M: Message>(
    followed: &Arc<Followed>,
    hub: &Arc<Hub>,
    more: fn(&mut Publisher, &Received<M>),
) -> io::Result<JoinHandle<()>> {
    let (hub, followed) = (Arc::clone(hub), Arc::clone(followed));
    let thread = thread::Builder::new().name(format!("fox-{}", M::TOPIC));
    thread.spawn(move || {
        let is_wanted = || !followed.view.is_stopping() && hub.wants_topic(M::TOPIC);
        while !followed.view.is_stopping() {
            let mut publisher = Publisher {
                hub: Arc::clone(&hub),
                followed: Arc::clone(&followed),
                drawn: None,
            };
            let published = follow_topic::<M>(&followed, &is_wanted, |message, _| {
                let Some(message) = message else { return };
                let stamp_ns = message.item().stamp_ns;
                for view in views(M::TOPIC, bytes_of(message.header())) {
                    hub.publish(view.channel, stamp_ns, view.data);
                }
                more(&mut publisher, message);
            });
            if let Err(error) = published {
                let notice = format!("{} is not shown: {error}.", M::TOPIC);
                hub.notice.send_replace(notice);
            }
        }
    })
}

impl Publisher {
    /// Publishes a view if it is wanted. A message that is too short for its header has none.
    fn publish(&self, channel: &str, stamp_ns: i64, view: impl FnOnce() -> Option<View>) {
        if self.hub.is_wanted(channel)
            && let Some(view) = view()
        {
            self.hub.publish(channel, stamp_ns, view.data);
        }
    }

    fn is_due(&mut self, interval: Duration) -> bool {
        let is_due = self.drawn.is_none_or(|drawn| drawn.elapsed() >= interval);
        if is_due {
            self.drawn = Some(Instant::now());
        }
        is_due
    }

    fn scan(&mut self, message: &Received<Scan>) {
        if self.is_due(PICTURE_INTERVAL) {
            self.image("/scan", message);
        }
    }

    fn masked(&mut self, message: &Received<Masked>) {
        if !self.is_due(PICTURE_INTERVAL) {
            return;
        }
        self.image("/masked", message);
        let header = message.header();
        self.publish(POINTS, header.item.stamp_ns, || {
            let points = header.points(message.values())?;
            Some(View::points(points, header))
        });
    }

    fn image<M: Message>(&self, channel: &str, message: &Received<M>) {
        let stamp_ns = message.item().stamp_ns;
        self.publish(channel, stamp_ns, || {
            let header = bytes_of(message.header());
            View::image_of(M::TOPIC, header, message.values(), stamp_ns)
        });
    }

    fn pose(&mut self, message: &Received<Pose>) {
        let item = message.item();
        if self.hub.is_wanted(LATENCY) {
            self.hub.publish(LATENCY, item.stamp_ns, latency(item));
        }
        if self.hub.is_wanted(TRAJECTORY) && self.is_due(TRAJECTORY_INTERVAL) {
            let poses = self.followed.view.trajectory().into_iter();
            let view = View::trajectory(poses, item.stamp_ns);
            self.hub.publish(TRAJECTORY, item.stamp_ns, view.data);
        }
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
            let report = health.borrow_and_update().clone();
            let report = report.map(|report| report.into_data().to_vec());
            hub.publish(HEALTH, stamp_ns, report.unwrap_or_default());
        }
    }
}

fn announce(followed: &Followed, hub: &Hub) -> Option<PathBuf> {
    let run = ObservedRun::writing_to(&followed.out).ok()?;
    let channels = hub.channels.iter().enumerate();
    let of_run = channels.filter(|(_, channel)| channel.is_of(run.manifest()));
    hub.of_run.send_replace(of_run.map(|(id, _)| id).collect());
    Some(run.manifest().events())
}
