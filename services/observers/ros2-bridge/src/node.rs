//! A node of ROS 2, and its topics.

use std::{error::Error, fmt::Display, net::IpAddr, time::Duration};

use gyre_client::RunError;
use gyre_ros2_messages::{Domain, Ros2Message};
use ros2_client::{
    Context, Message, MessageTypeName, Name, NodeName, NodeOptions, QosProfile, Server,
    ServiceMapping, ServiceTypeName, Subscription,
    dds::rustdds::DomainParticipantBuilder,
    qos::{Durability, History, Reliability, WhenFull},
};

use crate::outlet::Outlet;

/// The longest wait for slow readers, after which a message is dropped and counted.
const MAX_WAIT: Duration = Duration::from_millis(100);

/// Requests that are kept until they are answered.
const REQUESTS: usize = 10;

pub struct Node {
    node: ros2_client::Node,
    context: Context,
}

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

impl Node {
    pub fn new(domain: &Domain, namespace: &str, name: &str) -> Result<Self, RunError> {
        let node_name = NodeName::new(namespace, name)
            .map_err(|reason| name_error(&format!("{namespace} {name}"), &reason))?;
        let joined = join(domain, node_name);
        joined.map_err(|reason| {
            let domain = domain.id;
            RunError::Input(format!("cannot join domain {domain} of ROS 2: {reason}"))
        })
    }

    pub fn dds_name(&self, topic: &str) -> Result<String, RunError> {
        Ok(format!("rt{}", self.absolute(topic)?))
    }

    /// Returns the absolute name of a topic: the library makes `//` of one in the root.
    fn absolute(&self, topic: &str) -> Result<Name, RunError> {
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
    ) -> Result<Outlet<M>, RunError> {
        let opened = self.open::<M>(topic, &keep.qos())?;
        let publisher = self.node.create_publisher(&opened, None);
        let participant = self.context.domain_participant().clone();
        let dds_name = self.dds_name(topic)?;
        publisher
            .map(|publisher| Outlet::new(publisher, participant, dds_name))
            .map_err(|e| topic_error(topic, &e))
    }

    /// Publishes to a topic if it is wanted.
    pub fn publish_if<M: Ros2Message>(
        &mut self,
        is_wanted: bool,
        topic: &str,
        keep: Keep,
    ) -> Result<Option<Outlet<M>>, RunError> {
        is_wanted.then(|| self.publish(topic, keep)).transpose()
    }

    /// Offers a service below the name of the node, by its package and type.
    pub fn serve<Q: Message + Clone + 'static, A: Message + 'static>(
        &mut self,
        service: &str,
        [package, of]: [&str; 2],
    ) -> Result<Server<Q, A>, RunError> {
        let name = name(&self.below(service))?;
        let (of, qos) = (
            ServiceTypeName::new(package, of),
            Keep::Last(REQUESTS).qos(),
        );
        let enhanced = ServiceMapping::Enhanced;
        let server = self
            .node
            .create_server(enhanced, &name, &of, qos.clone(), qos);
        server.map_err(|error| {
            RunError::Input(format!(
                "cannot offer the service {service} of ROS 2: {error}"
            ))
        })
    }

    /// Returns a name below the name of the node, such as `/gyre/get_state`.
    pub fn below(&self, name: &str) -> String {
        format!("{}/{name}", self.node.fully_qualified_name())
    }

    /// Subscribes to a topic with room for so many messages that are not yet taken: reliably, or
    /// lossy, as drivers publish sensor data.
    pub fn subscribe<M: Ros2Message + 'static>(
        &mut self,
        topic: &str,
        depth: usize,
        is_lossy: bool,
    ) -> Result<Subscription<M>, RunError> {
        let qos = match is_lossy {
            true => Keep::Last(depth).qos().reliability(Reliability::BestEffort),
            false => Keep::Last(depth).qos(),
        };
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
    ) -> Result<ros2_client::dds::rustdds::Topic, RunError> {
        let definition = M::DEFINITION;
        let message = MessageTypeName::new(definition.package, definition.name);
        let opened = self.node.create_topic(&self.absolute(topic)?, message, qos);
        opened.map_err(|error| topic_error(topic, &error))
    }
}

fn join(domain: &Domain, name: NodeName) -> Result<Node, Box<dyn Error>> {
    let mut builder = DomainParticipantBuilder::new(domain.id);
    if let Some(address) = domain.interface {
        builder = builder.with_only_networks([IpAddr::V4(address)]);
    }
    let context = Context::from_domain_participant(builder.build()?)?;
    let options = NodeOptions::new()
        .enable_rosout(false)
        .start_parameter_services(false);
    let node = context.new_node(name, options)?;
    Ok(Node { node, context })
}

fn name(topic: &str) -> Result<Name, RunError> {
    Name::parse(topic).map_err(|reason| name_error(topic, &reason))
}

fn name_error(name: &str, reason: &dyn Display) -> RunError {
    RunError::Input(format!(
        "`{name}` is no name of ROS 2: {reason}; names are letters, digits and single `_`, between single `/`"
    ))
}

fn topic_error(topic: &str, reason: &dyn Display) -> RunError {
    RunError::Input(format!("cannot open the topic {topic} of ROS 2: {reason}"))
}
