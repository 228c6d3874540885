//! The threads that follow the run, and the next one in the same folder after its end.

use std::{thread, time::Duration};

use gyre_messages::{Correction, Pose, PoseHeader, outcome};
use gyre_ros2_messages::{
    frames::{self, Interval},
    nav_msgs::Odometry,
    tf2_msgs::TFMessage,
};
use gyre_stage::{
    StageError,
    observer::{Next, ObservedRun},
};

use crate::{
    clock::Clock,
    outlet::Outlet,
    shared::{Known, KnownRun, Shared, State},
};

/// Time between two looks for a run, and for a request to stop.
pub const LOOK: Duration = Duration::from_millis(200);

/// The topics that each pose is published on.
pub struct PoseTopics {
    pub odometry: Outlet<Odometry>,
    /// `None` where another program provides the transforms.
    pub transforms: Option<Outlet<TFMessage>>,
}

/// Calls `follow` for each run, with what is known of it, until the bridge stops. A run that could not be followed is tried again until it
/// ends.
pub fn each_run(
    shared: &Shared,
    mut follow: impl FnMut(&ObservedRun, &KnownRun) -> Result<(), StageError>,
) {
    while !shared.is_stopping() {
        let Ok(run) = ObservedRun::writing_to(&shared.out) else {
            // There is none.
            thread::sleep(LOOK);
            continue;
        };
        let known = shared.begin(run.manifest());
        match follow(&run, &known) {
            Ok(()) => await_end(shared, &run),
            Err(StageError::NotRunning(_)) => {}
            Err(error) => {
                known.lock().notice = Some(error.to_string());
                thread::sleep(LOOK);
            }
        }
    }
}

/// Waits until the results are written and the run is gone.
fn await_end(shared: &Shared, run: &ObservedRun) {
    while !shared.is_stopping() && !run.has_ended() {
        thread::sleep(LOOK);
    }
}

/// Publishes the poses of each run.
pub fn follow_poses(shared: &Shared, mut topics: PoseTopics, say: fn(&str)) {
    each_run(shared, |run, known| {
        shared.show(known);
        let followed = follow_run(shared, run, known, &mut topics, say);
        if followed.is_ok() {
            known.lock().state = State::Finishing;
            await_end(shared, run);
        }
        if run.has_ended() {
            known.lock().state = State::Ended;
            let sentence = sentence(&known.lock());
            say(&sentence);
        }
        followed
    });
}

/// What was published of a run.
fn sentence(known: &Known) -> String {
    let first = known.first.unwrap_or_default();
    format!(
        "the run has ended: {} poses from number {first} on and {} maps published, {} poses missed; {} messages not sent because readers were behind",
        known.poses, known.maps, known.missed, known.unsent
    )
}

fn follow_run(
    shared: &Shared,
    run: &ObservedRun,
    known: &KnownRun,
    topics: &mut PoseTopics,
    say: fn(&str),
) -> Result<(), StageError> {
    let mut poses = run.observe::<Pose>()?;
    known.lock().notice = None;
    let mut unsent = topics.unsent();
    while !shared.is_stopping() {
        match poses.next(LOOK)? {
            Next::Message(message, _) => publish(shared, known, message.header(), topics, say),
            Next::Idle => {}
            Next::Ended => break,
        }
        known.lock().unsent += topics.unsent() - unsent;
        unsent = topics.unsent();
    }
    Ok(())
}

/// Publishes a pose as odometry and as transforms, of which that of the map comes from the loops of a run with SLAM.
fn publish(
    shared: &Shared,
    known: &KnownRun,
    pose: &PoseHeader,
    topics: &mut PoseTopics,
    say: fn(&str),
) {
    let (clock, map_from_odometry) = {
        let mut known = known.lock();
        // One that was published before the stream was lost and found again.
        if !known.count(pose.item.seq) {
            return;
        }
        let is_first = known.clock.is_none();
        let clock = *known
            .clock
            .get_or_insert_with(|| Clock::of(pose.item.stamp_ns));
        if is_first && !clock.is_sensors() {
            say(
                "the times of this run do not count from 1970: its stamps in ROS begin with this computer's time at the first pose",
            );
        }
        (clock, known.map_from_odometry)
    };
    let (frames, mounting) = (&shared.frames, &shared.mounting);
    let stamp_ns = clock.stamp_ns(pose.item.stamp_ns);
    let vehicle = mounting.of_vehicle_uncertain(&pose.pose());
    let since = Interval {
        motion: mounting.of_vehicle_uncertain(&pose.motion.motion().alone()),
        duration_ns: pose.motion.interval_ns,
        is_measured: pose.motion.refinement.outcome != outcome::PREDICTED,
    };
    if let Some(transforms) = &mut topics.transforms {
        let base = frames::transform(stamp_ns, &frames.odom, &frames.base, &vehicle.motion);
        let corrected = map_from_odometry.map(|correction| {
            let corrected = mounting.of_vehicle(&correction);
            frames::transform(stamp_ns, &frames.map, &frames.odom, &corrected)
        });
        transforms.send(TFMessage {
            transforms: corrected.into_iter().chain([base]).collect(),
        });
    }
    let odometry = frames::odometry(stamp_ns, frames, &vehicle, Some(&since));
    topics.odometry.send(odometry);
}

impl PoseTopics {
    fn unsent(&self) -> u64 {
        let transforms = self.transforms.as_ref().map_or(0, Outlet::unsent);
        self.odometry.unsent() + transforms
    }
}

/// Takes the corrections of each run with SLAM.
pub fn follow_corrections(shared: &Shared) {
    each_run(shared, |run, known| {
        if !run.manifest().window.slam {
            return Ok(());
        }
        let mut corrections = run.observe::<Correction>()?;
        while !shared.is_stopping() {
            match corrections.next(LOOK)? {
                Next::Message(message, _) => {
                    let correction = message.header().map_from_odometry();
                    known.lock().map_from_odometry = Some(correction);
                }
                Next::Idle => {}
                Next::Ended => break,
            }
        }
        Ok(())
    });
}
