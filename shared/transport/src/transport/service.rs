//! Topics of the transport.

use gyre_contract::{Topic, Window, WireType};
use iceoryx2::{
    prelude::{CallbackProgression, PortFactory},
    service::{
        builder::publish_subscribe::Builder,
        port_factory::publish_subscribe,
        static_config::message_type_details::{TypeDetail, TypeVariant},
    },
};

use super::{AnyHeader, AnyPayload, Ipc, Node, service_name};
use crate::RunError;

pub struct Service {
    pub(crate) topic: &'static Topic,
    pub(crate) factory: publish_subscribe::PortFactory<Ipc, AnyPayload, AnyHeader>,
}

impl Service {
    pub(crate) fn create(
        node: &Node,
        topic: &'static Topic,
        window: &Window,
    ) -> Result<Self, RunError> {
        let sizes = (topic.sizes)(window);
        let factory = builder(node, topic)?
            .enable_safe_overflow(true)
            .history_size(sizes.history)
            .subscriber_max_buffer_size(sizes.buffer)
            .subscriber_max_borrowed_samples(sizes.borrowed)
            .max_publishers(1)
            .max_subscribers(sizes.subscribers())
            .max_nodes(sizes.nodes())
            .create()
            .map_err(|e| RunError::transport(format!("create the topic {}", topic.name), e))?;
        Ok(Self { topic, factory })
    }

    /// Opens a topic, which the supervisor has created.
    pub fn open(node: &Node, topic: &'static Topic) -> Result<Self, RunError> {
        let factory = builder(node, topic)?
            .open()
            .map_err(|e| RunError::transport(format!("open the topic {}", topic.name), e))?;
        Ok(Self { topic, factory })
    }

    /// Returns whether a process publishes it. A dead one counts until its resources are removed.
    pub(crate) fn has_publisher(&self) -> bool {
        self.factory.dynamic_config().number_of_publishers() > 0
    }

    pub fn subscribers(&self) -> usize {
        self.factory.dynamic_config().number_of_subscribers()
    }

    pub fn subscribers_named(&self, name: &str) -> usize {
        let mut named = 0;
        self.factory
            .dynamic_config()
            .list_subscribers(|subscriber| {
                named += usize::from(subscriber.subscriber_name.as_str() == name);
                CallbackProgression::Continue
            });
        named
    }
}

fn builder(node: &Node, topic: &Topic) -> Result<Builder<AnyPayload, AnyHeader, Ipc>, RunError> {
    let (header, elements) = (
        detail(TypeVariant::FixedSize, &topic.header)?,
        detail(TypeVariant::Dynamic, &topic.element)?,
    );
    let builder = node
        .0
        .service_builder(&service_name(topic.name)?)
        .publish_subscribe::<AnyPayload>()
        .user_header::<AnyHeader>();
    // SAFETY: these are the sizes and alignments of the types whose values are read and written as
    // bytes here.
    Ok(unsafe {
        builder
            .__internal_set_user_header_type_details(&header)
            .__internal_set_payload_type_details(&elements)
    })
}

/// Describes a type as the transport does itself for a type that it is generic in.
fn detail(variant: TypeVariant, of: &WireType) -> Result<TypeDetail, RunError> {
    TypeDetail::__internal_new_from_parts(variant, of.name, of.bytes, of.alignment)
        .map_err(|e| RunError::transport(format!("describe {}", of.name), e))
}
