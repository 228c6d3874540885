//! The threads that follow the run, and the next one in the same folder after its end.

use std::{thread, time::Duration};

use gyre_messages::{Correction, Message, Objects, ObjectsHeader, Pose, PoseHeader, outcome};
use gyre_ros2_messages::{
    frames::{self, Interval},
    nav_msgs::Odometry,
    objects,
    tf2_msgs::TFMessage,
    vision_msgs::Detection3DArray,
    visualization_msgs::MarkerArray,
};
use gyre_stage::{
    StageError,
    observer::{Next, ObservedRun},
};

use crate::{
    outlet::Outlet,
    run_state::{RunPhase, RunState, Shared, SharedRunState},
};

pub const POLL_INTERVAL: Duration = Duration::from_millis(200);

pub struct PoseTopics {
    pub odometry: Outlet<Odometry>,
    /// `None` where another program provides the transforms.
    pub transforms: Option<Outlet<TFMessage>>,
}

pub struct ObjectTopics {
    pub detections: Outlet<Detection3DArray>,
    pub markers: Outlet<MarkerArray>,
}

/// Calls `follow` for each run, with its state, until the bridge stops. A run that could not be
/// followed is tried again until it ends.
pub fn each_run(
    shared: &Shared,
    mut follow: impl FnMut(&ObservedRun, &SharedRunState) -> Result<(), StageError>,
) {
    while !shared.is_stopping() {
        let Ok(run) = ObservedRun::writing_to(&shared.out) else {
            // There is no run yet.
            thread::sleep(POLL_INTERVAL);
            continue;
        };
        let manifest = run.manifest();
        let state = shared.begin(&manifest.prefix, manifest.window.slam);
        match follow(&run, &state) {
            Ok(()) => await_end(shared, &run),
            Err(StageError::NotRunning { .. }) => {}
            Err(error) => {
                state.lock().notice = Some(error.to_string());
                thread::sleep(POLL_INTERVAL);
            }
        }
    }
}

/// Waits until the results are written and the run is gone.
fn await_end(shared: &Shared, run: &ObservedRun) {
    while !shared.is_stopping() && !run.has_ended() {
        thread::sleep(POLL_INTERVAL);
    }
}

pub fn follow_poses(shared: &Shared, mut topics: PoseTopics, say: fn(&str)) {
    each_run(shared, |run, state| {
        shared.show(state);
        state.lock().notice = None;
        let followed = each_message::<Pose>(shared, run, |pose| {
            publish(shared, state, pose, &mut topics, say);
        });
        if followed.is_ok() {
            state.lock().phase = RunPhase::Finishing;
            await_end(shared, run);
        }
        if run.has_ended() {
            state.lock().phase = RunPhase::Ended;
            let sentence = sentence(&state.lock());
            say(&sentence);
        }
        followed
    });
}

fn sentence(state: &RunState) -> String {
    let (poses, first) = (state.poses.published, state.poses.first.unwrap_or_default());
    let (objects, maps, unsent) = (state.objects.published, state.maps, state.unsent);
    let (missed, missed_objects) = (state.poses.missed, state.objects.missed);
    format!(
        "the run has ended: {poses} poses from number {first} on, {maps} maps and the objects of {objects} scans published, the objects of {missed_objects} scans and {missed} poses missed; {unsent} messages not sent because readers were behind"
    )
}

/// Calls `take` with the header of each message of a topic, until the stream ends or the bridge
/// stops.
fn each_message<M: Message>(
    shared: &Shared,
    run: &ObservedRun,
    mut take: impl FnMut(&M::Header),
) -> Result<(), StageError> {
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

/// Publishes a pose as odometry and as transforms; the map's transform comes from the loops of
/// SLAM.
fn publish(
    shared: &Shared,
    state: &SharedRunState,
    pose: &PoseHeader,
    topics: &mut PoseTopics,
    say: fn(&str),
) {
    let (stamp_ns, map_from_odometry) = {
        let mut state = state.lock();
        // The pose was published before the stream was interrupted.
        if !state.poses.count(pose.item.seq) {
            return;
        }
        let stamp_ns = stamp_ns(&mut state, pose.item.stamp_ns, say);
        (stamp_ns, state.map_from_odometry)
    };
    let (frames, mounting) = (&shared.frames, &shared.mounting);
    let vehicle = mounting.of_vehicle_uncertain(&pose.pose());
    let since = Interval {
        motion: mounting.of_vehicle_uncertain(&pose.motion.motion().alone()),
        duration_ns: pose.motion.interval_ns,
        is_measured: pose.motion.refinement.outcome != outcome::PREDICTED,
    };
    let mut unsent = 0;
    if let Some(transforms) = &mut topics.transforms {
        let base = frames::transform(stamp_ns, &frames.odom, &frames.base, &vehicle.motion);
        let corrected = map_from_odometry.map(|correction| {
            let corrected = mounting.of_vehicle(&correction);
            frames::transform(stamp_ns, &frames.map, &frames.odom, &corrected)
        });
        let is_sent = transforms.send(TFMessage {
            transforms: corrected.into_iter().chain([base]).collect(),
        });
        unsent += u64::from(!is_sent);
    }
    let odometry = frames::odometry(stamp_ns, frames, &vehicle, Some(&since));
    unsent += u64::from(!topics.odometry.send(odometry));
    state.lock().unsent += unsent;
}

/// Returns a time of the run as a time of ROS, and reports the first difference between the two.
fn stamp_ns(state: &mut RunState, time_ns: i64, say: fn(&str)) -> i64 {
    let (stamp_ns, is_first) = state.stamp_ns(time_ns);
    if is_first && stamp_ns != time_ns {
        say(
            "the times of this run do not count from 1970: its stamps in ROS begin with this computer's time at the first pose",
        );
    }
    stamp_ns
}

pub fn follow_corrections(shared: &Shared) {
    each_run(shared, |run, state| {
        if !run.manifest().window.slam {
            return Ok(());
        }
        each_message::<Correction>(shared, run, |correction| {
            state.lock().map_from_odometry = Some(correction.map_from_odometry());
        })
    });
}

pub fn follow_objects(shared: &Shared, mut topics: ObjectTopics, say: fn(&str)) {
    each_run(shared, |run, state| {
        if !run.manifest().window.objects {
            return Ok(());
        }
        each_message::<Objects>(shared, run, |objects| {
            topics.publish(shared, state, objects, say);
        })
    });
}

impl ObjectTopics {
    /// Publishes the objects of a scan, even an empty list.
    fn publish(
        &mut self,
        shared: &Shared,
        state: &SharedRunState,
        header: &ObjectsHeader,
        say: fn(&str),
    ) {
        let stamp_ns = {
            let mut state = state.lock();
            // They were published before the stream was interrupted.
            if !state.objects.count(header.item.seq) {
                return;
            }
            stamp_ns(&mut state, header.item.stamp_ns, say)
        };
        let (frames, mounting, listed) = (&shared.frames, &shared.mounting, header.list());
        let detections = objects::detections(stamp_ns, frames, mounting, listed);
        let markers = objects::markers(stamp_ns, frames, mounting, listed);
        let sent = [self.detections.send(detections), self.markers.send(markers)];
        state.lock().unsent += sent.map(|is_sent| u64::from(!is_sent)).iter().sum::<u64>();
    }
}
