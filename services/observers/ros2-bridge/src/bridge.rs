//! The bridge: a node that publishes the runs of a folder.

use std::thread;

use gyre_client::{RunError, Signals, clock};
use gyre_ros2_messages::{diagnostic_msgs::DiagnosticArray, tf2_msgs::TFMessage};

use crate::{
    Settings,
    following::{ObjectTopics, PoseTopics, Topics, follow_runs},
    health::report,
    live_map::MapTopic,
    node::{Keep, Node},
    outlet::Outlet,
    run_state::{POLL_INTERVAL, Shared},
};

const NODE: &str = "gyre";
/// Messages that are kept for slow readers: 25 s at four turns a second.
const DEPTH: usize = 100;

pub struct Bridge {
    shared: Shared,
    topics: Topics,
    /// Kept open for later readers.
    mounting: Outlet<TFMessage>,
    diagnostics: Outlet<DiagnosticArray>,
    /// Dropped last: it owns the topics.
    _node: Node,
}

impl Bridge {
    pub fn open(settings: Settings) -> Result<Self, RunError> {
        let mut node = Node::new(&settings.domain, &settings.namespace, NODE)?;
        Ok(Self {
            topics: Topics {
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
                map: match settings.map {
                    Some(settings) => Some(MapTopic {
                        settings,
                        maps: node.publish("map", Keep::Latched)?,
                    }),
                    None => None,
                },
            },
            mounting: node.publish("/tf_static", Keep::Latched)?,
            diagnostics: node.publish("/diagnostics", Keep::Last(DEPTH))?,
            shared: Shared::new(settings.out, settings.vehicle),
            _node: node,
        })
    }

    /// Publishes until a signal arrives, and passes sentences for the terminal to the callback.
    pub fn publish(mut self, signals: &Signals, say: fn(&str)) -> Result<(), RunError> {
        let shared = &self.shared;
        let mounted = shared.vehicle.mounted(clock::since_1970_ns());
        self.mounting.send(mounted);
        thread::scope(|threads| {
            threads.spawn(|| follow_runs(shared, self.topics, say));
            threads.spawn(|| report(shared, self.diagnostics));
            let mut stopped = Ok(false);
            while let Ok(false) = stopped {
                stopped = signals.sleep(POLL_INTERVAL);
            }
            shared.stop();
            stopped.map(drop)
        })
    }
}
