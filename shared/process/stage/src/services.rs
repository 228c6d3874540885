//! The services of the transport: the supervisor creates them once with the sizes of the window, and stages only open them.
//! So no restart finds a service missing or of another size.

use gyre_messages::{
    Correction, Fix, FollowerId, Loop, Masked, Message, Motion, Pose, Refined, Rotation, Scan,
    StageId, TopicSizes, Window,
};
use iceoryx2::{
    prelude::{Config, NodeBuilder, NodeName, ServiceName, SignalHandlingMode, ipc},
    service::port_factory::{PortFactory, event, publish_subscribe},
};

use crate::{StageError, log_id::LOGS};

/// The kind of services: shared memory between processes.
pub type Ipc = ipc::Service;
/// A process in the transport.
pub type Node = iceoryx2::node::Node<Ipc>;
/// A topic, which ports are opened of.
pub type Topic<M> =
    publish_subscribe::PortFactory<Ipc, [<M as Message>::Element], <M as Message>::Header>;
pub(crate) type Event = event::PortFactory<Ipc>;
/// The receiver of an event's notifications.
pub type Listener = iceoryx2::port::listener::Listener<Ipc>;
pub(crate) type Notifier = iceoryx2::port::notifier::Notifier<Ipc>;

/// Spare ports of an event: a listener that is killed during its creation can occupy one until the run ends.
const HEADROOM: usize = 6;

/// Creates a node of this run. The transport's tools show its name.
///
/// # Errors
/// A failure of the transport.
pub fn node(config: &Config, name: &str) -> Result<Node, StageError> {
    let name = NodeName::new(name).map_err(|e| StageError::transport("name the node", e))?;
    NodeBuilder::new()
        .name(&name)
        .config(config)
        .signal_handling_mode(SignalHandlingMode::Disabled)
        .create::<Ipc>()
        .map_err(|e| StageError::transport("join the run", e))
}

/// All services of a run. They exist as long as this value.
pub struct Services {
    scan: Topic<Scan>,
    masked: Topic<Masked>,
    rotation: Topic<Rotation>,
    motion: Topic<Motion>,
    refined: Topic<Refined>,
    pose: Topic<Pose>,
    /// In a run with SLAM.
    _slam: Option<(Topic<Loop>, Topic<Correction>)>,
    /// In a run with a map.
    _fixes: Option<Topic<Fix>>,
    _events: Vec<Event>,
}

impl Services {
    /// Creates the services.
    ///
    /// # Errors
    /// A failure of the transport.
    pub fn create(node: &Node, window: &Window) -> Result<Self, StageError> {
        let mut events = Vec::new();
        for topic in gyre_messages::topics(window) {
            events.extend(create_events(node, topic.name, &(topic.sizes)(window))?);
        }
        let fixes = window.localises.then(|| create_topic::<Fix>(node, window));
        let mut slam = None;
        if window.slam {
            let loops = create_topic::<Loop>(node, window)?;
            slam = Some((loops, create_topic::<Correction>(node, window)?));
            let sizes = EventSizes {
                listeners: FollowerId::ALL.len(),
                notifiers: 1,
                nodes: Pose::sizes(window).nodes(),
            };
            for log in LOGS {
                events.push(create_event(node, log.event(), sizes)?);
            }
        }
        Ok(Self {
            scan: create_topic::<Scan>(node, window)?,
            masked: create_topic::<Masked>(node, window)?,
            rotation: create_topic::<Rotation>(node, window)?,
            motion: create_topic::<Motion>(node, window)?,
            refined: create_topic::<Refined>(node, window)?,
            pose: create_topic::<Pose>(node, window)?,
            _slam: slam,
            _fixes: fixes.transpose()?,
            _events: events,
        })
    }

    /// Returns whether a stage has opened the topic that it publishes, which stages do last. A dead stage counts until its
    /// resources are removed.
    pub fn has_publisher(&self, stage: StageId) -> bool {
        let publishers = match stage {
            StageId::RadarReplay => self.scan.dynamic_config().number_of_publishers(),
            StageId::Masking => self.masked.dynamic_config().number_of_publishers(),
            StageId::RotationSearch => self.rotation.dynamic_config().number_of_publishers(),
            StageId::TranslationSearch | StageId::JointSearch => {
                self.motion.dynamic_config().number_of_publishers()
            }
            StageId::Refinement => self.refined.dynamic_config().number_of_publishers(),
            StageId::PoseIntegration => self.pose.dynamic_config().number_of_publishers(),
        };
        publishers > 0
    }
}

/// Returns the name of the event with which a publisher wakes the readers of a topic.
pub(crate) fn data_event(topic: &str) -> String {
    format!("{topic}_data")
}

/// Returns the name of the event with which a new reader notifies the publisher of a topic.
pub(crate) fn handshake_event(topic: &str) -> String {
    format!("{topic}_handshake")
}

fn service_name(name: &str) -> Result<ServiceName, StageError> {
    ServiceName::new(name).map_err(|e| StageError::transport(format!("name the service {name}"), e))
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
        create_event(node, &data_event(topic), data)?,
        create_event(node, &handshake_event(topic), handshake)?,
    ])
}

pub(crate) fn create_topic<M: Message>(
    node: &Node,
    window: &Window,
) -> Result<Topic<M>, StageError> {
    let sizes = M::sizes(window);
    node.service_builder(&service_name(M::TOPIC)?)
        .publish_subscribe::<[M::Element]>()
        .user_header::<M::Header>()
        .enable_safe_overflow(true)
        .history_size(sizes.history)
        .subscriber_max_buffer_size(sizes.buffer)
        .subscriber_max_borrowed_samples(sizes.borrowed)
        .max_publishers(1)
        .max_subscribers(sizes.subscribers())
        .max_nodes(sizes.nodes())
        .create()
        .map_err(|e| StageError::transport(format!("create the topic {}", M::TOPIC), e))
}

/// Numbers of ports that an event has room for, without the spare ones.
#[derive(Clone, Copy)]
struct EventSizes {
    listeners: usize,
    notifiers: usize,
    nodes: usize,
}

fn create_event(node: &Node, name: &str, sizes: EventSizes) -> Result<Event, StageError> {
    node.service_builder(&service_name(name)?)
        .event()
        .max_listeners(sizes.listeners + HEADROOM)
        .max_notifiers(sizes.notifiers + HEADROOM)
        .max_nodes(sizes.nodes)
        .event_id_max_value(1)
        .create()
        .map_err(|e| StageError::transport(format!("create the event {name}"), e))
}

/// Opens a topic, which the supervisor has created.
///
/// # Errors
/// A failure of the transport.
pub fn open_topic<M: Message>(node: &Node) -> Result<Topic<M>, StageError> {
    node.service_builder(&service_name(M::TOPIC)?)
        .publish_subscribe::<[M::Element]>()
        .user_header::<M::Header>()
        .open()
        .map_err(|e| StageError::transport(format!("open the topic {}", M::TOPIC), e))
}

pub(crate) fn listener(node: &Node, event: &str) -> Result<Listener, StageError> {
    open_event(node, event)?
        .listener_builder()
        .create()
        .map_err(|e| StageError::transport(format!("listen to {event}"), e))
}

pub(crate) fn notifier(node: &Node, event: &str) -> Result<Notifier, StageError> {
    open_event(node, event)?
        .notifier_builder()
        .create()
        .map_err(|e| StageError::transport(format!("notify {event}"), e))
}

fn open_event(node: &Node, name: &str) -> Result<Event, StageError> {
    node.service_builder(&service_name(name)?)
        .event()
        .open()
        .map_err(|e| StageError::transport(format!("open the event {name}"), e))
}
