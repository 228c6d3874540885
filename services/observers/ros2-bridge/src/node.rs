//! A node of ROS 2, and its topics.

use std::{net::IpAddr, time::Duration};

use gyre_ros2_messages::{Domain, Ros2Message};
use ros2_client::{
    Context, MessageTypeName, Name, NodeName, NodeOptions, QosProfile, Subscription,
    dds::rustdds::{DomainParticipant, DomainParticipantBuilder},
    qos::{Durability, History, Reliability, WhenFull},
};
use thiserror::Error;

use crate::outlet::Outlet;

/// The longest wait for slow readers, after which a message is dropped and counted.
const MAX_WAIT: Duration = Duration::from_millis(100);

/// A node that cannot be made, or a topic.
#[derive(Debug, Error)]
pub enum NodeError {
    #[error("cannot join domain {domain} of ROS 2: {reason}")]
    Domain { domain: u16, reason: String },
    #[error(
        "`{name}` is no name of ROS 2: {reason}; names are letters, digits and single `_`, between single `/`"
    )]
    Name { name: String, reason: String },
    #[error("cannot open the topic {topic} of ROS 2: {reason}")]
    Topic { topic: String, reason: String },
}

pub struct Node {
    node: ros2_client::Node,
    context: Context,
}

/// The messages of a topic that are kept for its readers.
#[derive(Clone, Copy, Debug)]
pub enum Keep {
    /// The last messages, for readers that are behind.
    Last(usize),
    /// The newest message, also for readers that come later (transient local).
    Latched,
}

impl Keep {
    /// Returns a reliable quality of service, which also serves readers of best effort.
    fn qos(self) -> QosProfile {
        let (durability, depth) = match self {
            Self::Last(depth) => (Durability::Volatile, depth),
            Self::Latched => (Durability::TransientLocal, 1),
        };
        QosProfile::publisher_default()
            .reliability(Reliability::Reliable {
                when_full: WhenFull::Wait(MAX_WAIT),
            })
            .durability(durability)
            .history(History::KeepLast { depth })
    }
}

/// Joins a domain, or returns why not.
fn join(domain: &Domain) -> Result<DomainParticipant, String> {
    let builder = DomainParticipantBuilder::new(domain.id());
    let builder = match domain.interface() {
        Some(address) => builder.with_only_networks([IpAddr::V4(address)]),
        None => builder,
    };
    builder.build().map_err(|error| error.to_string())
}

impl Node {
    /// Joins a domain as a node of this name in this namespace, such as `/` or `/robot`.
    pub fn new(domain: &Domain, namespace: &str, name: &str) -> Result<Self, NodeError> {
        let failed = |reason: String| NodeError::Domain {
            domain: domain.id(),
            reason,
        };
        let node_name = NodeName::new(namespace, name).map_err(|error| NodeError::Name {
            name: format!("{namespace} {name}"),
            reason: error.to_string(),
        })?;
        let participant = join(domain).map_err(failed)?;
        let context = Context::from_domain_participant(participant)
            .map_err(|error| failed(error.to_string()))?;
        let options = NodeOptions::new()
            .enable_rosout(false)
            .start_parameter_services(false);
        let node = context
            .new_node(node_name, options)
            .map_err(|error| failed(error.to_string()))?;
        Ok(Self { node, context })
    }

    /// Returns the name on DDS of a topic, absolute or relative to the namespace.
    pub fn dds_name(&self, topic: &str) -> Result<String, NodeError> {
        Ok(format!("rt{}", self.absolute(topic)?))
    }

    /// Returns the absolute name of a topic: the library makes `//` of one in the root.
    fn absolute(&self, topic: &str) -> Result<Name, NodeError> {
        let name = name(topic)?;
        match name.is_absolute() {
            true => Ok(name),
            false => {
                let namespace = self.node.namespace().trim_end_matches('/');
                self::name(&format!("{namespace}/{topic}"))
            }
        }
    }

    pub fn publish<M: Ros2Message>(
        &mut self,
        topic: &str,
        keep: Keep,
    ) -> Result<Outlet<M>, NodeError> {
        let opened = self.open::<M>(topic, &keep.qos())?;
        let publisher = self.node.create_publisher(&opened, None);
        publisher
            .map(Outlet::new)
            .map_err(|error| topic_error(topic, &error))
    }

    /// Subscribes to a topic reliably, with room for so many messages that are not yet taken.
    pub fn subscribe<M: Ros2Message + 'static>(
        &mut self,
        topic: &str,
        depth: usize,
    ) -> Result<Subscription<M>, NodeError> {
        let opened = self.open::<M>(topic, &Keep::Last(depth).qos())?;
        let subscription = self.node.create_subscription(&opened, None);
        subscription.map_err(|error| topic_error(topic, &error))
    }

    /// Subscribes to a lossy topic, as drivers use for sensor data, with room for `depth` messages
    /// that are not yet taken.
    pub fn subscribe_to_sensor<M: Ros2Message + 'static>(
        &mut self,
        topic: &str,
        depth: usize,
    ) -> Result<Subscription<M>, NodeError> {
        let qos = Keep::Last(depth).qos().reliability(Reliability::BestEffort);
        let opened = self.open::<M>(topic, &qos)?;
        let subscription = self.node.create_subscription(&opened, None);
        subscription.map_err(|error| topic_error(topic, &error))
    }

    /// Returns the type on DDS of a topic by its name on DDS; `None` while there is no publisher.
    pub fn type_of(&self, dds_name: &str) -> Option<String> {
        let participant = self.context.domain_participant();
        let writers = participant.discovered_writers();
        let mut topics = writers.iter().map(|writer| &writer.publication_topic_data);
        let topic = topics.find(|topic| topic.topic_name == dds_name)?;
        Some(topic.type_name.clone())
    }

    fn open<M: Ros2Message>(
        &self,
        topic: &str,
        qos: &QosProfile,
    ) -> Result<ros2_client::dds::rustdds::Topic, NodeError> {
        let definition = M::DEFINITION;
        let message = MessageTypeName::new(definition.package, definition.name);
        let opened = self.node.create_topic(&self.absolute(topic)?, message, qos);
        opened.map_err(|error| topic_error(topic, &error))
    }
}

fn name(topic: &str) -> Result<Name, NodeError> {
    Name::parse(topic).map_err(|error| NodeError::Name {
        name: topic.to_owned(),
        reason: error.to_string(),
    })
}

fn topic_error(topic: &str, error: &ros2_client::CreateError) -> NodeError {
    NodeError::Topic {
        topic: topic.to_owned(),
        reason: error.to_string(),
    }
}
