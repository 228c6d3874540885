//! Definitions of messages: names and fields, as ROS 2 writes them.

/// The definition of a message type.
#[derive(Debug)]
pub struct Definition {
    /// The package, such as `nav_msgs`.
    pub package: &'static str,
    /// The type without its package, such as `Odometry`.
    pub name: &'static str,
    /// The fields, one a line, as in its `.msg` file.
    pub fields: &'static str,
    /// The types of its fields that are messages themselves.
    pub parts: &'static [&'static Definition],
}

/// Separates the definitions of a schema of the encoding `ros2msg`.
const SEPARATOR: &str =
    "================================================================================\n";

impl Definition {
    /// Returns the full name, such as `nav_msgs/msg/Odometry`.
    pub fn type_name(&self) -> String {
        format!("{}/msg/{}", self.package, self.name)
    }

    /// Returns the name on DDS, such as `nav_msgs::msg::dds_::Odometry_`.
    pub fn dds_name(&self) -> String {
        format!("{}::msg::dds_::{}_", self.package, self.name)
    }

    /// Returns the fields, and after them the fields of all types in them: a schema of the encoding
    /// `ros2msg`, as in bags.
    pub fn text(&self) -> String {
        let mut parts = Vec::new();
        self.collect(&mut parts);
        let mut text = self.fields.to_owned();
        for part in parts {
            text += SEPARATOR;
            text += &format!("MSG: {}/{}\n{}", part.package, part.name, part.fields);
        }
        text
    }

    /// Adds all types in this one, each once.
    fn collect(&self, parts: &mut Vec<&'static Definition>) {
        for part in self.parts {
            if !parts.iter().any(|known| std::ptr::eq(*known, *part)) {
                parts.push(part);
                part.collect(parts);
            }
        }
    }
}

/// A message of ROS 2.
pub trait Ros2Message: serde::Serialize + serde::de::DeserializeOwned {
    const DEFINITION: &'static Definition;
}

/// Defines the [`Definition`] of a message type.
macro_rules! message {
    ($type:ident, $package:literal, $fields:literal, [$($part:path),*]) => {
        impl crate::Ros2Message for $type {
            const DEFINITION: &'static crate::Definition = &crate::Definition {
                package: $package,
                name: stringify!($type),
                fields: $fields,
                parts: &[$(<$part as crate::Ros2Message>::DEFINITION),*],
            };
        }
    };
}
pub(crate) use message;
