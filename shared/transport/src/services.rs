//! The services of the transport: the supervisor creates them once with the sizes of the window,
//! and stages only open them. So no restart finds a service missing or of another size.

use gyre_contract::{FollowerId, Message, Pose, Sender, StageId, Topic, Window};

use crate::{
    RunError,
    transport::{Event, Node, Notifier, Service, data_event, handshake_event},
};

gyre_contract::named! {
    /// A log of a run that followers read; its name is the event of its growth.
    #[derive(Clone, Copy, Debug, PartialEq, Eq)]
    pub enum LogId {
        Keyframes = "keyframes_grown",
        Loops = "loops_grown",
        /// All scans with their points, by pose-integration.
        Scans = "scans_grown",
    }
}

impl LogId {
    /// Opens the event that wakes the followers of the log, as the one process that appends to it.
    pub fn growth(self, node: &Node) -> Result<Notifier, RunError> {
        Notifier::open(node, self.name())
    }
}

/// All services of a run. They exist as long as this value.
pub struct Services {
    topics: Vec<Service>,
    _events: Vec<Event>,
}

impl Services {
    pub fn create(node: &Node, window: &Window) -> Result<Self, RunError> {
        let (mut topics, mut events) = (Vec::new(), Vec::new());
        let mut event = |name: &str, ports, nodes| -> Result<(), RunError> {
            events.push(Event::create(node, name, ports, nodes)?);
            Ok(())
        };
        for topic in gyre_contract::topics(window) {
            let (name, sizes) = (topic.name, (topic.sizes)(window));
            let (subscribers, nodes) = (sizes.subscribers(), sizes.nodes());
            event(&data_event(name), [subscribers, 1], nodes)?;
            event(&handshake_event(name), [1, subscribers], nodes)?;
            topics.push(Service::create(node, topic, window)?);
        }
        if window.logs_points() {
            let nodes = Pose::sizes(window).nodes();
            for log in LogId::ALL {
                event(log.name(), [FollowerId::ALL.len(), 1], nodes)?;
            }
        }
        Ok(Self {
            topics,
            _events: events,
        })
    }

    pub fn subscribers(&self, topic: &str) -> usize {
        let topics = self.topics.iter().filter(|it| it.topic.name == topic);
        topics.map(Service::subscribers).sum()
    }

    /// Returns whether a stage has opened the topic that it publishes, which stages do last. A dead
    /// stage counts until its resources are removed.
    pub fn has_publisher(&self, stage: StageId) -> bool {
        let is_sent = |topic: &Topic| match topic.sender {
            Sender::Stage(stages) => stages.contains(&stage),
            Sender::Follower(_) => false,
        };
        let mut topics = self.topics.iter();
        topics.any(|service| is_sent(service.topic) && service.has_publisher())
    }
}
