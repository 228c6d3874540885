//! The threads that observe the topics that viewers want.

use std::{
    io, iter,
    path::PathBuf,
    sync::Arc,
    thread::{self, JoinHandle},
    time::{Duration, Instant},
};

use gyre_client::{Received, Run, clock};
use gyre_contract::{Masked, MaskedHeader, Message, Pose, Topic};
use gyre_recording::{
    LogTail,
    view::{LOG, POINTS, TRAJECTORY, View, image_channel, views},
};

use super::{
    Hub,
    measurements::{HEALTH, LATENCY, latency},
};
use crate::{
    observing::{Followed, follow_topic},
    run_view::RunView,
};

/// Time between two polls for the log and the report, and for a request to stop.
const POLL_INTERVAL: Duration = Duration::from_millis(200);
/// The shortest time between two pictures of a topic, for recordings that are played fast.
const PICTURE_INTERVAL: Duration = Duration::from_millis(50);

const TRAJECTORY_INTERVAL: Duration = Duration::from_secs(1);

pub fn start(followed: &Arc<Followed>, hub: &Arc<Hub>) -> io::Result<Vec<JoinHandle<()>>> {
    let report = {
        let (followed, hub) = (Arc::clone(followed), Arc::clone(hub));
        let thread = thread::Builder::new().name("foxglove".to_owned());
        thread.spawn(move || report(&followed, &hub))?
    };
    let is_shown = |topic: &&Topic| {
        let mut channels = hub.channels.iter();
        channels.any(|it| it.topic == Some(topic.name))
    };
    let topics = gyre_contract::all().filter(is_shown);
    let threads = topics.map(|topic| follow(followed, hub, topic));
    iter::once(Ok(report)).chain(threads).collect()
}

/// Follows a topic. The views that take long are published at most once in an interval.
fn follow(
    followed: &Arc<Followed>,
    hub: &Arc<Hub>,
    topic: &'static Topic,
) -> io::Result<JoinHandle<()>> {
    let interval = match topic.name {
        Pose::TOPIC => TRAJECTORY_INTERVAL,
        _ => PICTURE_INTERVAL,
    };
    let (hub, followed) = (Arc::clone(hub), Arc::clone(followed));
    let thread = thread::Builder::new().name(format!("fox-{}", topic.name));
    thread.spawn(move || {
        let is_wanted = || !followed.view.is_stopping() && hub.wants_topic(topic.name);
        let observe = |run: &Run| run.observe_topic(topic);
        let mut drawn: Option<Instant> = None;
        while !followed.view.is_stopping() {
            let published = follow_topic(&followed, observe, &is_wanted, |message, _| {
                let item = message.item();
                for view in views(topic.name, message.header_bytes()) {
                    hub.publish(view.channel, item.stamp_ns, view.data);
                }
                if topic.name == Pose::TOPIC && hub.is_wanted(LATENCY) {
                    hub.publish(LATENCY, item.stamp_ns, latency(item));
                }
                if drawn.is_none_or(|drawn| drawn.elapsed() >= interval) {
                    drawn = Some(Instant::now());
                    draw(&hub, &followed.view, topic.name, message);
                }
            });
            if let Err(error) = published {
                let notice = format!("{} is not shown: {error}.", topic.name);
                hub.notice.send_replace(notice);
            }
        }
    })
}

/// Publishes the views that take long. A message that is too short for its header has no image.
fn draw<M>(hub: &Hub, run: &RunView, topic: &str, message: &Received<M>) {
    let (header, stamp_ns) = (message.header_bytes(), message.item().stamp_ns);
    if let Some(channel) = image_channel(topic)
        && hub.is_wanted(channel)
        && let Some(view) = View::image_of(topic, header, message.values(), stamp_ns)
    {
        hub.publish(channel, stamp_ns, view.data);
    }
    if topic == Masked::TOPIC && hub.is_wanted(POINTS) {
        let header: &MaskedHeader = bytemuck::from_bytes(header);
        if let Some(points) = header.points(message.values()) {
            hub.publish(POINTS, stamp_ns, View::points(points, header).data);
        }
    }
    if topic == Pose::TOPIC && hub.is_wanted(TRAJECTORY) {
        let view = View::trajectory(run.trajectory().into_iter(), stamp_ns);
        hub.publish(TRAJECTORY, stamp_ns, view.data);
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
    let run = Run::open(&followed.out).ok()?;
    let channels = hub.channels.iter().enumerate();
    let of_run = channels.filter(|(_, channel)| channel.is_of(run.manifest()));
    hub.of_run.send_replace(of_run.map(|(id, _)| id).collect());
    Some(run.manifest().events())
}
