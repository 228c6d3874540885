//! The channels that viewers can subscribe to.

use base64::{Engine, prelude::BASE64_STANDARD};
use gyre_client::Manifest;
use gyre_contract::{Message, Pose};
use gyre_recording::view::{CHANNELS, POINTS, TRAJECTORY};
use serde_json::{Value, json};

use super::measurements::{HEALTH, LATENCY, health_schema, latency_schema};

/// A channel. Its number is its place in [`all`].
pub struct Channel {
    pub name: &'static str,
    /// The topic of the run that it is made of; `None`: every run has the channel.
    pub topic: Option<&'static str>,
    /// True if a slow viewer is sent the newest message only.
    pub is_bulky: bool,
    pub advertised: Value,
}

impl Channel {
    pub fn is_of(&self, manifest: &Manifest) -> bool {
        self.topic.is_none_or(|name| manifest.has_topic(name))
    }

    fn measured(name: &'static str, topic: Option<&'static str>, schema: &Value) -> Self {
        let advertised = json!({
            "topic": name,
            "encoding": "json",
            "schemaName": format!("gyre{}", name.replace('/', ".")),
            "schemaEncoding": "jsonschema",
            "schema": schema.to_string(),
        });
        Self {
            name,
            topic,
            is_bulky: false,
            advertised,
        }
    }
}

pub fn all() -> Vec<Channel> {
    let drawn = CHANNELS.iter().filter_map(|channel| {
        let schema = (channel.schema)()?;
        let name = channel.name;
        let advertised = json!({
            "topic": name,
            "encoding": "protobuf",
            "schemaName": schema.name,
            "schemaEncoding": schema.encoding,
            "schema": BASE64_STANDARD.encode(&schema.data),
        });
        Some(Channel {
            name,
            topic: channel.topic,
            is_bulky: matches!(name, "/scan" | "/masked") || [POINTS, TRAJECTORY].contains(&name),
            advertised,
        })
    });
    let measured = [
        Channel::measured(LATENCY, Some(Pose::TOPIC), &latency_schema()),
        Channel::measured(HEALTH, None, &health_schema()),
    ];
    let mut channels: Vec<_> = drawn.chain(measured).collect();
    for (id, channel) in channels.iter_mut().enumerate() {
        channel.advertised["id"] = id.into();
    }
    channels
}
