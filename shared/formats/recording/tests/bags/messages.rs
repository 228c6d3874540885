//! Messages of a bag, and a file of them.

use std::{collections::BTreeMap, fs, path::Path};

use gyre_ros2_messages::{Ros2Message, encode};
use mcap::WriteOptions;

/// The content of a bag: topic, schema, time and bytes of each message.
#[derive(Default)]
pub struct Messages(pub Vec<(String, String, String, i64, Vec<u8>)>);

impl Messages {
    pub fn add<T: Ros2Message>(&mut self, topic: &str, log_ns: i64, message: &T) {
        let (name, text) = (T::DEFINITION.type_name(), T::DEFINITION.text());
        self.add_bytes(topic, (&name, &text), log_ns, encode(message).unwrap());
    }

    pub fn add_bytes(
        &mut self,
        topic: &str,
        (name, text): (&str, &str),
        log_ns: i64,
        bytes: Vec<u8>,
    ) {
        let texts = [topic, name, text].map(str::to_owned);
        let [topic, name, text] = texts;
        self.0.push((topic, name, text, log_ns, bytes));
    }

    /// Writes an MCAP file as recorders other than Gyre do.
    pub fn write(&self, path: &Path, options: WriteOptions) {
        let file = fs::File::create(path).unwrap();
        let mut mcap = options.profile("ros2").create(file).unwrap();
        for (sequence, (topic, name, text, log_ns, data)) in self.0.iter().enumerate() {
            let schema = mcap.add_schema(name, "ros2msg", text.as_bytes()).unwrap();
            let channel = mcap
                .add_channel(schema, topic, "cdr", &BTreeMap::new())
                .unwrap();
            let header = mcap::records::MessageHeader {
                channel_id: channel,
                sequence: sequence as u32,
                log_time: *log_ns as u64,
                publish_time: *log_ns as u64,
            };
            mcap.write_to_known_channel(&header, data).unwrap();
        }
        mcap.finish().unwrap();
    }
}
