//! The threads that follow a run, and the next one in the same folder after its end.

use std::{thread, time::Duration};

use gyre_client::{Manifest, Next, Run, RunError};
use gyre_contract::{
    Correction, Fix, Item, Masked, Message, Objects, ObjectsHeader, Pose, PoseHeader,
    PredictedPose, PredictedPoseHeader, Witness, flag,
};
use gyre_ros2_messages::{builtin_interfaces::Time, objects, rosgraph_msgs::Clock};

use serde::Serialize;

use crate::{
    RunSettings, live_map,
    outlet::Outlet,
    run_state::{Counts, POLL_INTERVAL, RunPhase, RunState, Shared},
    topics::{ObjectTopics, PoseTopics, RunTopics},
};

pub fn follow_runs(shared: &Shared, mut topics: RunTopics) {
    while !shared.is_stopping() {
        let Ok(run) = Run::open(&shared.settings.out) else {
            // There is no run yet.
            thread::sleep(POLL_INTERVAL);
            continue;
        };
        let manifest = run.manifest();
        shared.begin(manifest.window.slam);
        let settings = (shared.settings.of_run)(&shared.settings.out);
        match own_topic(&settings, &topics.poses) {
            Some(sentence) => {
                shared.say(&sentence);
                shared.state().notice = Some(sentence);
                await_end(shared, &run);
            }
            None => follow_run(shared, manifest, &settings, &mut topics),
        }
        if run.has_ended() {
            shared.state().phase = RunPhase::Ended;
            let sentence = sentence(&shared.state());
            shared.say(&sentence);
        }
    }
}

/// Follows a topic of a run to its end.
type Follow<'a> = Box<dyn FnMut(&Run) -> Result<(), RunError> + Send + 'a>;

/// Calls `take` with the header of each message of a topic, until the stream ends or the bridge
/// stops.
fn each<'a, M: Message>(
    shared: &'a Shared,
    mut take: impl FnMut(&M::Header) + Send + 'a,
) -> Follow<'a> {
    Box::new(move |run| {
        let mut observer = run.observe::<M>()?;
        while !shared.is_stopping() {
            match observer.next(POLL_INTERVAL)? {
                Next::Message(message, _) => take(message.header()),
                Next::Idle => {}
                Next::Ended => break,
            }
        }
        Ok(())
    })
}

/// Returns a sentence if the run would receive its own odometry as the speed of its wheels.
fn own_topic(settings: &Result<RunSettings, String>, topics: &PoseTopics) -> Option<String> {
    let mut received = settings.iter().flat_map(|it| &it.sensor_topics);
    let topic = received.find(|topic| topics.odometry.is(topic))?;
    Some(format!(
        "the run is not published: it receives its wheels from {topic}, the topic of its own odometry; start the bridge with --namespace"
    ))
}

/// Follows the topics of a run in a thread each, until the run has ended or the bridge stops.
fn follow_run(
    shared: &Shared,
    manifest: &Manifest,
    settings: &Result<RunSettings, String>,
    topics: &mut RunTopics,
) {
    let (name, window) = (manifest.prefix.as_str(), &manifest.window);
    let is = |of: fn(&RunSettings) -> bool| settings.as_ref().is_ok_and(of);
    let RunTopics {
        poses,
        objects,
        doppler,
        fixes,
        map,
    } = topics;
    poses.has_clock = is(|it| it.is_replay);
    if poses.clock.is_some() && !poses.has_clock {
        let unread = settings.as_ref().err().map(String::as_str);
        let reason = unread.unwrap_or("the run does not play a recording");
        shared.say(&format!("/clock is not published: {reason}"));
    }
    let vehicle = &shared.settings.vehicle;
    let (has_doppler, predicts) = (is(|it| it.has_doppler), is(|it| it.predicts));
    let mut followed: Vec<Follow<'_>> = vec![Box::new(move |run| {
        follow_poses(shared, run, poses, predicts)
    })];
    if window.objects {
        followed.push(each::<Objects>(shared, |it| objects.publish(shared, it)));
    }
    if has_doppler {
        followed.push(each::<Masked>(shared, |it| {
            publish_some(
                doppler,
                shared,
                &it.item,
                |state| &mut state.doppler,
                |stamp_ns| Some(vehicle.doppler(stamp_ns, it.of(Witness::Doppler)?)),
            );
        }));
    }
    if window.localises {
        followed.push(each::<Fix>(shared, |it| {
            publish_some(
                fixes,
                shared,
                &it.item,
                |state| &mut state.fixes,
                |stamp_ns| vehicle.fix(stamp_ns, it),
            );
        }));
    }
    if window.slam {
        followed.push(each::<Correction>(shared, |it| {
            shared.state().map_from_odometry = Some(it.map_from_odometry());
        }));
    }
    if let Some(maps) = map.as_mut().filter(|_| window.slam) {
        followed.push(Box::new(|run| {
            live_map::follow(shared, run, settings, maps);
            Ok(())
        }));
    }
    thread::scope(|threads| {
        for follow in followed {
            threads.spawn(move || until_end(shared, name, follow));
        }
    });
}

/// Calls `follow` with the run of this name, again after a failure, and waits for the end of the
/// run: until the results are written.
fn until_end(shared: &Shared, name: &str, mut follow: Follow<'_>) {
    while !shared.is_stopping() {
        let followed = match Run::open(&shared.settings.out) {
            Ok(run) if run.manifest().prefix != name => return,
            Ok(run) => follow(&run).map(|()| await_end(shared, &run)),
            Err(error) => Err(error),
        };
        match followed {
            Ok(()) | Err(RunError::NotRunning { .. }) => return,
            Err(error) => {
                shared.state().notice = Some(error.to_string());
                thread::sleep(POLL_INTERVAL);
            }
        }
    }
}

fn await_end(shared: &Shared, run: &Run) {
    while !shared.is_stopping() && !run.has_ended() {
        thread::sleep(POLL_INTERVAL);
    }
}

fn follow_poses(
    shared: &Shared,
    run: &Run,
    topics: &mut PoseTopics,
    predicts: bool,
) -> Result<(), RunError> {
    shared.state().notice = None;
    (topics.predicted_ns, topics.last) = (None, None);
    let mut poses = run.observe::<Pose>()?;
    let mut predictions = match predicts {
        true => Some(run.observe::<PredictedPose>()?),
        false => None,
    };
    while !shared.is_stopping() {
        let mut limit = POLL_INTERVAL;
        if let Some(predictions) = &mut predictions
            && let Next::Message(message, _) = predictions.next(POLL_INTERVAL)?
        {
            topics.publish_prediction(shared, message.header());
            limit = Duration::ZERO;
        }
        match poses.next(limit)? {
            Next::Message(message, _) => topics.publish(shared, message.header()),
            Next::Idle => {}
            Next::Ended => break,
        }
    }
    shared.state().phase = RunPhase::Finishing;
    Ok(())
}

fn sentence(state: &RunState) -> String {
    let (poses, first) = (state.poses.published, state.poses.first.unwrap_or_default());
    let (objects, maps, unsent) = (state.objects.published, state.maps, state.unsent);
    let (missed, missed_objects) = (state.poses.missed(), state.objects.missed());
    let mut sentence = format!(
        "the run has ended: {poses} poses from number {first} on, {maps} maps and the objects of {objects} scans published, the objects of {missed_objects} scans and {missed} poses missed; {unsent} messages not sent because readers were behind"
    );
    for (count, reason) in [
        (state.unread, "published while odom had no reader"),
        (state.predictions.published, "between scans published"),
        (
            state.poses.left_out,
            "not published, since a prediction was ahead of them",
        ),
        (
            state.poses.held_back,
            "not published, since the node was not active",
        ),
    ] {
        if count > 0 {
            sentence += &format!("; {count} poses {reason}");
        }
    }
    sentence
}

type CountsOf = fn(&mut RunState) -> &mut Counts;

/// Counts a message of a topic; returns its time in ROS, ns, if it is to be published: not while
/// the node is inactive, nor if it was published before the stream was interrupted.
fn counted(shared: &Shared, item: &Item, counts: CountsOf) -> Option<i64> {
    let (is_active, mut state) = (shared.is_active(), shared.state());
    let is_new = counts(&mut state).count(item, is_active);
    is_new.then(|| state.stamp_ns(item.stamp_ns, shared.settings.say))
}

impl PoseTopics {
    /// Publishes a pose as odometry and as transforms; the map's transform comes from the loops of
    /// SLAM.
    fn publish(&mut self, shared: &Shared, pose: &PoseHeader) {
        let Some(stamp_ns) = counted(shared, &pose.item, |state| &mut state.poses) else {
            return;
        };
        shared.state().motions.add(&pose.motion.refinement);
        self.last = Some(*pose);
        // The sensor's clock may have stepped back.
        if pose.item.is(flag::BREAK) {
            self.predicted_ns = None;
        }
        // The time comes first: a later stamp is in the future of a reader.
        if let Some(topic) = self.clock.as_mut().filter(|_| self.has_clock) {
            let clock = Time::from_ns(stamp_ns);
            shared.sent(topic.send(Clock { clock }));
        }
        // A prediction is ahead of the next scan.
        match self
            .predicted_ns
            .is_some_and(|ahead_ns| ahead_ns >= stamp_ns)
        {
            true => shared.state().poses.leave_out(),
            false => self.send(shared, pose, stamp_ns),
        }
    }

    /// Publishes a pose between scans in the same way, with the last velocity.
    fn publish_prediction(&mut self, shared: &Shared, predicted: &PredictedPoseHeader) {
        let counts: CountsOf = |state| &mut state.predictions;
        let Some(stamp_ns) = counted(shared, &predicted.item, counts) else {
            return;
        };
        // Nothing is predicted where a chain starts: the prediction is of the chain before.
        let Some(last) = self.last.filter(|last| !last.item.is(flag::BREAK)) else {
            return shared.state().predictions.leave_out();
        };
        let pose = PoseHeader {
            x_m: predicted.x_m,
            y_m: predicted.y_m,
            yaw_rad: predicted.yaw_rad,
            covariance: predicted.covariance,
            ..last
        };
        self.predicted_ns = Some(stamp_ns);
        self.send(shared, &pose, stamp_ns);
    }

    /// Sends odometry and transforms.
    fn send(&mut self, shared: &Shared, pose: &PoseHeader, stamp_ns: i64) {
        let vehicle = &shared.settings.vehicle;
        if let Some(topic) = &mut self.transforms {
            let (map, ahead_ns) = (shared.state().map_from_odometry, shared.settings.ahead_ns);
            shared.sent(topic.send(vehicle.transforms(stamp_ns, pose, map.as_ref(), ahead_ns)));
        }
        let is_unread = !self.odometry.has_reader();
        shared.sent(self.odometry.send(vehicle.odometry(stamp_ns, pose)));
        shared.state().unread += u64::from(is_unread);
    }
}

impl ObjectTopics {
    /// Publishes the objects of a scan, even an empty list.
    fn publish(&mut self, shared: &Shared, header: &ObjectsHeader) {
        let counts: CountsOf = |state| &mut state.objects;
        let Some(stamp_ns) = counted(shared, &header.item, counts) else {
            return;
        };
        let (vehicle, listed) = (&shared.settings.vehicle, header.list());
        let detections = objects::detections(stamp_ns, vehicle, listed);
        shared.sent(self.detections.send(detections));
        shared.sent(
            self.markers
                .send(objects::markers(stamp_ns, vehicle, listed)),
        );
    }
}

/// Publishes the message of an item, if it has one, and counts it.
fn publish_some<M: Serialize>(
    topic: &mut Outlet<M>,
    shared: &Shared,
    item: &Item,
    counts: CountsOf,
    message: impl FnOnce(i64) -> Option<M>,
) {
    let Some(stamp_ns) = counted(shared, item, counts) else {
        return;
    };
    match message(stamp_ns) {
        Some(message) => shared.sent(topic.send(message)),
        None => counts(&mut shared.state()).leave_out(),
    }
}
