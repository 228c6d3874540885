//! The `metadata.yaml` of a bag, in version 5 of ROS 2 Humble, which later versions read.

use std::fmt::Write;

use super::Kept;

pub(super) struct Described {
    pub channel: u16,
    pub name: String,
    pub type_name: String,
    /// The qualities of service, as YAML.
    pub qualities: String,
    pub messages: u64,
}

/// Returns the qualities of service of a topic, as `rosbag2` writes them: the last message or a
/// hundred kept, reliable, no deadlines.
pub(super) fn qualities(kept: Kept) -> String {
    // The numbers are defined by rmw: history keep last, reliability reliable, durability transient
    // local or volatile.
    let (depth, durability) = match kept {
        Kept::ForLater => (1, 1),
        Kept::ForNobody => (100, 2),
    };
    let endless = "\n    sec: 9223372036\n    nsec: 854775807";
    format!(
        "- history: 1\n  depth: {depth}\n  reliability: 1\n  durability: {durability}\n  deadline:{endless}\n  lifespan:{endless}\n  \
         liveliness: 1\n  liveliness_lease_duration:{endless}\n  avoid_ros_namespace_conventions: false"
    )
}

/// Returns the description of a bag with one file, from the first to the last time in it, ns
/// since 1970.
pub(super) fn text(file: &str, topics: &[Described], times: Option<(i64, i64)>) -> String {
    let (first_ns, last_ns) = times.unwrap_or_default();
    let duration_ns = last_ns - first_ns;
    let messages: u64 = topics.iter().map(|topic| topic.messages).sum();
    let file = quoted(file);
    let mut text = format!(
        "rosbag2_bagfile_information:\n  version: 5\n  storage_identifier: mcap\n  duration:\n    nanoseconds: {duration_ns}\n  \
         starting_time:\n    nanoseconds_since_epoch: {first_ns}\n  message_count: {messages}\n  topics_with_message_count:\n"
    );
    for topic in topics {
        let _ = write!(
            text,
            "    - topic_metadata:\n        name: {}\n        type: {}\n        serialization_format: cdr\n        \
             offered_qos_profiles: {}\n      message_count: {}\n",
            quoted(&topic.name),
            quoted(&topic.type_name),
            quoted(&topic.qualities),
            topic.messages
        );
    }
    let _ = write!(
        text,
        "  compression_format: \"\"\n  compression_mode: \"\"\n  relative_file_paths:\n    - {file}\n  files:\n    - path: {file}\n      \
         starting_time:\n        nanoseconds_since_epoch: {first_ns}\n      duration:\n        nanoseconds: {duration_ns}\n      \
         message_count: {messages}\n"
    );
    text
}

/// Returns a text between double quotes, as JSON and YAML have it.
fn quoted(text: &str) -> String {
    serde_json::Value::from(text).to_string()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_quoted() {
        assert_eq!(quoted("a \"b\" \\ \n\u{7}"), r#""a \"b\" \\ \n\u0007""#);
    }
}
