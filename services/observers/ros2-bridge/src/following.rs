//! The threads that follow a run, and the next one in the same folder after its end.

use std::thread;

use gyre_client::{Manifest, Next, Run, RunError};
use gyre_contract::{Correction, Message, Objects, ObjectsHeader, Pose, PoseHeader};
use gyre_ros2_messages::{
    nav_msgs::Odometry, objects, tf2_msgs::TFMessage, vision_msgs::Detection3DArray,
    visualization_msgs::MarkerArray,
};

use crate::{
    live_map::MapTopic,
    outlet::Outlet,
    run_state::{POLL_INTERVAL, RunPhase, RunState, Shared},
};

pub struct Topics {
    pub poses: PoseTopics,
    pub objects: ObjectTopics,
    pub map: Option<MapTopic>,
}

pub struct PoseTopics {
    pub odometry: Outlet<Odometry>,
    /// `None` where another program provides the transforms.
    pub transforms: Option<Outlet<TFMessage>>,
}

pub struct ObjectTopics {
    pub detections: Outlet<Detection3DArray>,
    pub markers: Outlet<MarkerArray>,
}

pub fn follow_runs(shared: &Shared, mut topics: Topics, say: fn(&str)) {
    while !shared.is_stopping() {
        let Ok(run) = Run::open(&shared.out) else {
            // There is no run yet.
            thread::sleep(POLL_INTERVAL);
            continue;
        };
        let manifest = run.manifest();
        shared.begin(manifest.window.slam);
        follow_run(shared, manifest, &mut topics, say);
        if run.has_ended() {
            shared.state().phase = RunPhase::Ended;
            let sentence = sentence(&shared.state());
            say(&sentence);
        }
    }
}

/// Follows the topics of a run in a thread each, until the run has ended or the bridge stops.
fn follow_run(shared: &Shared, manifest: &Manifest, topics: &mut Topics, say: fn(&str)) {
    let (name, window) = (manifest.prefix.as_str(), &manifest.window);
    let Topics {
        poses,
        objects,
        map,
    } = topics;
    thread::scope(|threads| {
        threads.spawn(move || {
            until_end(shared, name, |run| follow_poses(shared, run, poses, say));
        });
        if window.objects {
            threads.spawn(move || {
                until_end(shared, name, |run| {
                    each_message::<Objects>(shared, run, |header| {
                        objects.publish(shared, header, say);
                    })
                });
            });
        }
        if window.slam {
            threads.spawn(move || {
                until_end(shared, name, |run| {
                    each_message::<Correction>(shared, run, |correction| {
                        shared.state().map_from_odometry = Some(correction.map_from_odometry());
                    })
                });
            });
            if let Some(map) = map {
                threads.spawn(move || {
                    until_end(shared, name, |run| {
                        map.follow(shared, run);
                        Ok(())
                    });
                });
            }
        }
    });
}

/// Calls `follow` with the run of this name, again after a failure, and waits for the end of the
/// run: until the results are written.
fn until_end(shared: &Shared, name: &str, mut follow: impl FnMut(&Run) -> Result<(), RunError>) {
    while !shared.is_stopping() {
        let followed = match Run::open(&shared.out) {
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
    say: fn(&str),
) -> Result<(), RunError> {
    shared.state().notice = None;
    each_message::<Pose>(shared, run, |pose| topics.publish(shared, pose, say))?;
    shared.state().phase = RunPhase::Finishing;
    Ok(())
}

fn sentence(state: &RunState) -> String {
    let (poses, first) = (state.poses.published, state.poses.first.unwrap_or_default());
    let (objects, maps, unsent) = (state.objects.published, state.maps, state.unsent);
    let (missed, missed_objects) = (state.poses.missed(), state.objects.missed());
    format!(
        "the run has ended: {poses} poses from number {first} on, {maps} maps and the objects of {objects} scans published, the objects of {missed_objects} scans and {missed} poses missed; {unsent} messages not sent because readers were behind"
    )
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
        let (stamp_ns, map_from_odometry) = {
            let mut state = shared.state();
            // The pose was published before the stream was interrupted.
            if !state.poses.count(&pose.item) {
                return;
            }
            let stamp_ns = state.stamp_ns(pose.item.stamp_ns, say);
            (stamp_ns, state.map_from_odometry)
        };
        let (vehicle, mut unsent) = (&shared.vehicle, 0);
        if let Some(topic) = &mut self.transforms {
            let transforms = vehicle.transforms(stamp_ns, pose, map_from_odometry.as_ref());
            unsent += u64::from(!topic.send(transforms));
        }
        unsent += u64::from(!self.odometry.send(vehicle.odometry(stamp_ns, pose)));
        shared.state().unsent += unsent;
    }
}

impl ObjectTopics {
    /// Publishes the objects of a scan, even an empty list.
    fn publish(&mut self, shared: &Shared, header: &ObjectsHeader, say: fn(&str)) {
        let stamp_ns = {
            let mut state = shared.state();
            // They were published before the stream was interrupted.
            if !state.objects.count(&header.item) {
                return;
            }
            state.stamp_ns(header.item.stamp_ns, say)
        };
        let (vehicle, listed) = (&shared.vehicle, header.list());
        let detections = objects::detections(stamp_ns, vehicle, listed);
        let markers = objects::markers(stamp_ns, vehicle, listed);
        let sent = [self.detections.send(detections), self.markers.send(markers)];
        shared.state().unsent += sent.map(|is_sent| u64::from(!is_sent)).iter().sum::<u64>();
    }
}
