//! The threads that follow a run, and the next one in the same folder after its end.

use std::{thread, time::Duration};

use gyre_client::{Manifest, Next, Run, RunError};
use gyre_contract::{
    Correction, Fix, FixHeader, Item, Masked, MaskedHeader, Message, Objects, ObjectsHeader, Pose,
    PoseHeader, PredictedPose, PredictedPoseHeader, Witness, flag,
};
use gyre_ros2_messages::{
    builtin_interfaces::Time,
    geometry_msgs::{PoseWithCovarianceStamped, TwistWithCovarianceStamped},
    objects,
    rosgraph_msgs::Clock,
};

use serde::Serialize;

use crate::{
    RunSettings, live_map,
    outlet::Outlet,
    run_state::{Counts, POLL_INTERVAL, RunPhase, RunState, Shared},
    topics::{ObjectTopics, PoseTopics, RunTopics},
};

pub fn follow_runs(shared: &Shared, mut topics: RunTopics, say: fn(&str)) {
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
                say(&sentence);
                shared.state().notice = Some(sentence);
                await_end(shared, &run);
            }
            None => follow_run(shared, manifest, &settings, &mut topics, say),
        }
        if run.has_ended() {
            shared.state().phase = RunPhase::Ended;
            let sentence = sentence(&shared.state());
            say(&sentence);
        }
    }
}

/// Follows a topic of a run to its end.
type Follow<'a> = Box<dyn FnMut(&Run) -> Result<(), RunError> + Send + 'a>;

/// Calls `take` with the header of each message of a topic.
fn each<'a, M: Message>(
    shared: &'a Shared,
    mut take: impl FnMut(&M::Header) + Send + 'a,
) -> Follow<'a> {
    Box::new(move |run| each_message::<M>(shared, run, &mut take))
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
    say: fn(&str),
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
        say(&format!("/clock is not published: {reason}"));
    }
    let (has_doppler, predicts) = (is(|it| it.has_doppler), is(|it| it.predicts));
    let mut followed: Vec<Follow<'_>> = vec![Box::new(move |run| {
        follow_poses(shared, run, poses, predicts, say)
    })];
    if window.objects {
        followed.push(each::<Objects>(shared, |it| {
            objects.publish(shared, it, say)
        }));
    }
    if has_doppler {
        followed.push(each::<Masked>(shared, |it| {
            publish_doppler(doppler, shared, it, say)
        }));
    }
    if window.localises {
        followed.push(each::<Fix>(shared, |it| {
            publish_fix(fixes, shared, it, say)
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
    say: fn(&str),
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
            topics.publish_prediction(shared, message.header(), say);
            limit = Duration::ZERO;
        }
        match poses.next(limit)? {
            Next::Message(message, _) => topics.publish(shared, message.header(), say),
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

/// Calls `take` with the header of each message of a topic, until the stream ends or the bridge
/// stops.
fn each_message<M: Message>(
    shared: &Shared,
    run: &Run,
    mut take: impl FnMut(&M::Header),
) -> Result<(), RunError> {
    let mut observer = run.observe::<M>()?;
    while !shared.is_stopping() {
        match observer.next(POLL_INTERVAL)? {
            Next::Message(message, _) => take(message.header()),
            Next::Idle => {}
            Next::Ended => break,
        }
    }
    Ok(())
}

impl PoseTopics {
    /// Publishes a pose as odometry and as transforms; the map's transform comes from the loops of
    /// SLAM.
    fn publish(&mut self, shared: &Shared, pose: &PoseHeader, say: fn(&str)) {
        let is_active = shared.is_active();
        let (stamp_ns, map_from_odometry) = {
            let mut state = shared.state();
            // False also for a pose that was published before the stream was interrupted.
            if !state.poses.count(&pose.item, is_active) {
                return;
            }
            state.motions.add(&pose.motion.refinement);
            let stamp_ns = state.stamp_ns(pose.item.stamp_ns, say);
            (stamp_ns, state.map_from_odometry)
        };
        self.last = Some(*pose);
        // The sensor's clock may have stepped back.
        if pose.item.is(flag::BREAK) {
            self.predicted_ns = None;
        }
        let mut unsent = 0;
        // The time comes first: a later stamp is in the future of a reader.
        if let Some(topic) = self.clock.as_mut().filter(|_| self.has_clock) {
            let clock = Time::from_ns(stamp_ns);
            unsent += u64::from(!topic.send(Clock { clock }));
        }
        shared.state().unsent += unsent;
        // A prediction is ahead of the next scan.
        match self
            .predicted_ns
            .is_some_and(|ahead_ns| ahead_ns >= stamp_ns)
        {
            true => shared.state().poses.leave_out(),
            false => self.send(shared, pose, stamp_ns, map_from_odometry.as_ref()),
        }
    }

    /// Publishes a pose between scans in the same way, with the last velocity.
    fn publish_prediction(
        &mut self,
        shared: &Shared,
        predicted: &PredictedPoseHeader,
        say: fn(&str),
    ) {
        let is_active = shared.is_active();
        let (stamp_ns, map_from_odometry) = {
            let mut state = shared.state();
            if !state.predictions.count(&predicted.item, is_active) {
                return;
            }
            let stamp_ns = state.stamp_ns(predicted.item.stamp_ns, say);
            (stamp_ns, state.map_from_odometry)
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
        self.send(shared, &pose, stamp_ns, map_from_odometry.as_ref());
    }

    /// Sends odometry and transforms.
    fn send(
        &mut self,
        shared: &Shared,
        pose: &PoseHeader,
        stamp_ns: i64,
        map_from_odometry: Option<&gyre_geometry::Pose>,
    ) {
        let (vehicle, mut unsent) = (&shared.settings.vehicle, 0);
        if let Some(topic) = &mut self.transforms {
            let ahead_ns = shared.settings.ahead_ns;
            let transforms = vehicle.transforms(stamp_ns, pose, map_from_odometry, ahead_ns);
            unsent += u64::from(!topic.send(transforms));
        }
        let is_unread = !self.odometry.has_reader();
        unsent += u64::from(!self.odometry.send(vehicle.odometry(stamp_ns, pose)));
        let mut state = shared.state();
        state.unsent += unsent;
        state.unread += u64::from(is_unread);
    }
}

impl ObjectTopics {
    /// Publishes the objects of a scan, even an empty list.
    fn publish(&mut self, shared: &Shared, header: &ObjectsHeader, say: fn(&str)) {
        let is_active = shared.is_active();
        let stamp_ns = {
            let mut state = shared.state();
            // False also for objects that were published before the stream was interrupted.
            if !state.objects.count(&header.item, is_active) {
                return;
            }
            state.stamp_ns(header.item.stamp_ns, say)
        };
        let (vehicle, listed) = (&shared.settings.vehicle, header.list());
        let detections = objects::detections(stamp_ns, vehicle, listed);
        let markers = objects::markers(stamp_ns, vehicle, listed);
        let sent = [self.detections.send(detections), self.markers.send(markers)];
        shared.state().unsent += sent.map(|is_sent| u64::from(!is_sent)).iter().sum::<u64>();
    }
}

/// Publishes the velocity of a scan that Doppler has measured.
fn publish_doppler(
    topic: &mut Outlet<TwistWithCovarianceStamped>,
    shared: &Shared,
    scan: &MaskedHeader,
    say: fn(&str),
) {
    let vehicle = &shared.settings.vehicle;
    publish_some(
        topic,
        shared,
        &scan.item,
        say,
        |state| &mut state.doppler,
        |stamp_ns| {
            let velocity = scan.of(Witness::Doppler)?;
            Some(vehicle.doppler(stamp_ns, velocity))
        },
    );
}

/// Publishes the pose of a keyframe in the map of an earlier drive, if it was found there.
fn publish_fix(
    topic: &mut Outlet<PoseWithCovarianceStamped>,
    shared: &Shared,
    fix: &FixHeader,
    say: fn(&str),
) {
    let vehicle = &shared.settings.vehicle;
    publish_some(
        topic,
        shared,
        &fix.item,
        say,
        |state| &mut state.fixes,
        |stamp_ns| vehicle.fix(stamp_ns, fix),
    );
}

/// Publishes the message of an item, if it has one, and counts it.
fn publish_some<M: Serialize>(
    topic: &mut Outlet<M>,
    shared: &Shared,
    item: &Item,
    say: fn(&str),
    counts: fn(&mut RunState) -> &mut Counts,
    message: impl FnOnce(i64) -> Option<M>,
) {
    let is_active = shared.is_active();
    let mut state = shared.state();
    if !counts(&mut state).count(item, is_active) {
        return;
    }
    match message(state.stamp_ns(item.stamp_ns, say)) {
        Some(message) => {
            drop(state);
            let is_sent = topic.send(message);
            shared.state().unsent += u64::from(!is_sent);
        }
        None => counts(&mut state).leave_out(),
    }
}
