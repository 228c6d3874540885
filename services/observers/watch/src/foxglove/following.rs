//! The threads that observe the topics that viewers want.

use std::{
    io,
    path::PathBuf,
    sync::Arc,
    thread::{self, JoinHandle},
    time::{Duration, Instant},
};

use bytemuck::bytes_of;
use gyre_client::{Received, Run, clock};
use gyre_contract::{
    Correction, Fix, Loop, Masked, Message, Motion, Objects, Pose, Refined, Rotation, Scan,
};
use gyre_recording::{
    LogTail,
    view::{LOG, POINTS, TRAJECTORY, View, views},
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
    Ok(vec![
        report,
        follow::<Scan>(followed, hub, PICTURE_INTERVAL, scan)?,
        follow::<Masked>(followed, hub, PICTURE_INTERVAL, masked)?,
        follow::<Rotation>(followed, hub, PICTURE_INTERVAL, |_, _, _| {})?,
        follow::<Motion>(followed, hub, PICTURE_INTERVAL, |_, _, _| {})?,
        follow::<Refined>(followed, hub, PICTURE_INTERVAL, |_, _, _| {})?,
        follow::<Pose>(followed, hub, TRAJECTORY_INTERVAL, trajectory)?,
        follow::<Loop>(followed, hub, PICTURE_INTERVAL, |_, _, _| {})?,
        follow::<Correction>(followed, hub, PICTURE_INTERVAL, |_, _, _| {})?,
        follow::<Fix>(followed, hub, PICTURE_INTERVAL, |_, _, _| {})?,
        follow::<Objects>(followed, hub, PICTURE_INTERVAL, |_, _, _| {})?,
    ])
}

/// Follows a topic; `draw` publishes the views that take long, at most once in an interval.
fn follow<M: Message>(
    followed: &Arc<Followed>,
    hub: &Arc<Hub>,
    interval: Duration,
    draw: fn(&Hub, &RunView, &Received<M>),
) -> io::Result<JoinHandle<()>> {
    let (hub, followed) = (Arc::clone(hub), Arc::clone(followed));
    let thread = thread::Builder::new().name(format!("fox-{}", M::TOPIC));
    thread.spawn(move || {
        let is_wanted = || !followed.view.is_stopping() && hub.wants_topic(M::TOPIC);
        let mut drawn: Option<Instant> = None;
        while !followed.view.is_stopping() {
            let published = follow_topic::<M>(&followed, &is_wanted, |message, _| {
                let item = message.item();
                for view in views(M::TOPIC, bytes_of(message.header())) {
                    hub.publish(view.channel, item.stamp_ns, view.data);
                }
                if M::TOPIC == Pose::TOPIC && hub.is_wanted(LATENCY) {
                    hub.publish(LATENCY, item.stamp_ns, latency(item));
                }
                if drawn.is_none_or(|drawn| drawn.elapsed() >= interval) {
                    drawn = Some(Instant::now());
                    draw(&hub, &followed.view, message);
                }
            });
            if let Err(error) = published {
                let notice = format!("{} is not shown: {error}.", M::TOPIC);
                hub.notice.send_replace(notice);
            }
        }
    })
}

fn scan(hub: &Hub, _: &RunView, message: &Received<Scan>) {
    image(hub, "/scan", message);
}

fn masked(hub: &Hub, _: &RunView, message: &Received<Masked>) {
    image(hub, "/masked", message);
    let header = message.header();
    if hub.is_wanted(POINTS)
        && let Some(points) = header.points(message.values())
    {
        let view = View::points(points, header);
        hub.publish(POINTS, header.item.stamp_ns, view.data);
    }
}

/// Publishes the image of a message. One that is too short for its header has none.
fn image<M: Message>(hub: &Hub, channel: &str, message: &Received<M>) {
    let (header, stamp_ns) = (bytes_of(message.header()), message.item().stamp_ns);
    if hub.is_wanted(channel)
        && let Some(view) = View::image_of(M::TOPIC, header, message.values(), stamp_ns)
    {
        hub.publish(channel, stamp_ns, view.data);
    }
}

fn trajectory(hub: &Hub, view: &RunView, message: &Received<Pose>) {
    if hub.is_wanted(TRAJECTORY) {
        let stamp_ns = message.item().stamp_ns;
        let view = View::trajectory(view.trajectory().into_iter(), stamp_ns);
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
