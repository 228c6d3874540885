//! The bridge: a node that publishes the runs of a folder.

use std::thread;

use gyre_ros2_messages::{
    diagnostic_msgs::DiagnosticArray, frames, nav_msgs::OccupancyGrid, tf2_msgs::TFMessage,
};
use gyre_stage::{StageError, clock, wake::Signals};

use crate::{
    MapSettingsOf, NodeError, Settings,
    following::{
        ObjectTopics, POLL_INTERVAL, PoseTopics, follow_corrections, follow_objects, follow_poses,
    },
    health::report,
    live_map::follow_maps,
    node::{Keep, Node},
    outlet::Outlet,
    run_state::Shared,
};

const NODE: &str = "gyre";
/// Messages that are kept for slow readers: 25 s at four turns a second.
const DEPTH: usize = 100;

/// A node that publishes the runs of a folder, one after the other.
pub struct Bridge {
    shared: Shared,
    map_settings: Option<MapSettingsOf>,
    poses: PoseTopics,
    objects: ObjectTopics,
    /// Kept open for later readers.
    mounting: Outlet<TFMessage>,
    diagnostics: Outlet<DiagnosticArray>,
    maps: Outlet<OccupancyGrid>,
    /// Dropped last: it owns the topics.
    _node: Node,
}

impl Bridge {
    pub fn open(settings: Settings) -> Result<Self, NodeError> {
        let mut node = Node::new(&settings.domain, &settings.namespace, NODE)?;
        Ok(Self {
            poses: PoseTopics {
                odometry: node.publish("odom", Keep::Last(DEPTH))?,
                transforms: match settings.transforms {
                    true => Some(node.publish("/tf", Keep::Last(DEPTH))?),
                    false => None,
                },
            },
            objects: ObjectTopics {
                detections: node.publish("objects", Keep::Last(DEPTH))?,
                markers: node.publish("object_markers", Keep::Last(DEPTH))?,
            },
            mounting: node.publish("/tf_static", Keep::Latched)?,
            diagnostics: node.publish("/diagnostics", Keep::Last(DEPTH))?,
            maps: node.publish("map", Keep::Latched)?,
            shared: Shared::new(settings.out, settings.frames, settings.mounting),
            map_settings: settings.map,
            _node: node,
        })
    }

    /// Publishes until a signal arrives, and passes sentences for the terminal to the callback.
    pub fn publish(mut self, signals: &Signals, say: fn(&str)) -> Result<(), StageError> {
        let shared = &self.shared;
        let (frames, radar) = (&shared.frames, shared.mounting.radar());
        let now_ns = clock::since_1970_ns();
        // The place of the radar on the vehicle.
        let place = frames::transform(now_ns, &frames.base, &frames.radar, radar);
        self.mounting.send(TFMessage {
            transforms: vec![place],
        });
        thread::scope(|threads| {
            threads.spawn(|| follow_poses(shared, self.poses, say));
            threads.spawn(|| follow_corrections(shared));
            threads.spawn(|| follow_objects(shared, self.objects, say));
            threads.spawn(|| report(shared, self.diagnostics));
            if let Some(settings) = self.map_settings {
                threads.spawn(move || follow_maps(shared, settings, self.maps));
            }
            let mut stopped = Ok(false);
            while let Ok(false) = stopped {
                stopped = signals.sleep(POLL_INTERVAL);
            }
            shared.stop();
            stopped.map(drop)
        })
    }
}
