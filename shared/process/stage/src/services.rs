//! The services of the transport: the supervisor creates them once with the sizes of the window,
//! and stages only open them. So no restart finds a service missing or of another size.

use gyre_messages::{FollowerId, Message, Pose, Sender, StageId, Topic, TopicSizes, Window};

use crate::{
    StageError,
    log_id::LogId,
    transport::{Event, EventSizes, Node, Service},
};

/// All services of a run. They exist as long as this value.
pub struct Services {
    topics: Vec<(&'static Topic, Service)>,
    _events: Vec<Event>,
}

impl Services {
    pub fn create(node: &Node, window: &Window) -> Result<Self, StageError> {
        let (mut topics, mut events) = (Vec::new(), Vec::new());
        for topic in gyre_messages::topics(window) {
            events.extend(create_events(node, topic.name, &(topic.sizes)(window))?);
            topics.push((topic, Service::create(node, topic, window)?));
        }
        if window.logs_points() {
            let sizes = EventSizes {
                listeners: FollowerId::ALL.len(),
                notifiers: 1,
                nodes: Pose::sizes(window).nodes(),
            };
            for log in LogId::ALL {
                events.push(Event::create(node, log.name(), sizes)?);
            }
        }
        Ok(Self {
            topics,
            _events: events,
        })
    }

    /// Returns whether a stage has opened the topic that it publishes, which stages do last. A dead
    /// stage counts until its resources are removed.
    pub fn has_publisher(&self, stage: StageId) -> bool {
        let is_sent = |topic: &Topic| match topic.sender {
            Sender::Stage(stages) => stages.contains(&stage),
            Sender::Follower(_) => false,
        };
        let mut topics = self.topics.iter();
        topics.any(|(topic, service)| is_sent(topic) && service.has_publisher())
    }
}

pub(crate) fn data_event(topic: &str) -> String {
    format!("{topic}_data")
}

pub(crate) fn handshake_event(topic: &str) -> String {
    format!("{topic}_handshake")
}

/// Creates the two events of a topic: with its messages, and with its new readers.
pub(crate) fn create_events(
    node: &Node,
    topic: &str,
    sizes: &TopicSizes,
) -> Result<[Event; 2], StageError> {
    let data = EventSizes {
        listeners: sizes.subscribers(),
        notifiers: 1,
        nodes: sizes.nodes(),
    };
    let handshake = EventSizes {
        listeners: 1,
        notifiers: sizes.subscribers(),
        nodes: sizes.nodes(),
    };
    Ok([
        Event::create(node, &data_event(topic), data)?,
        Event::create(node, &handshake_event(topic), handshake)?,
    ])
}
