//! Definitions of messages: names and fields, as ROS 2 writes them; and messages as bytes: CDR,
//! after four bytes that state the byte order.

use std::fmt::Display;

use byteorder::{BigEndian, LittleEndian};

/// Plain CDR, little-endian, without options.
const LITTLE_ENDIAN: [u8; 4] = [0, 1, 0, 0];

#[derive(Debug)]
pub struct Definition {
    /// The package, such as `nav_msgs`.
    pub package: &'static str,
    /// The type without its package, such as `Odometry`.
    pub name: &'static str,
    /// The fields, one a line, as in its `.msg` file.
    pub fields: &'static str,
    /// The message that each field consists of; `None` for a number or a text.
    pub parts: &'static [Option<&'static Definition>],
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

    fn collect(&self, parts: &mut Vec<&'static Definition>) {
        for part in self.parts.iter().copied().flatten() {
            if !parts.iter().any(|known| std::ptr::eq(*known, part)) {
                parts.push(part);
                part.collect(parts);
            }
        }
    }
}

pub trait Ros2Message: serde::Serialize + serde::de::DeserializeOwned {
    const DEFINITION: &'static Definition;
}

/// Returns the sentence on bytes that are not a message of a type.
pub(crate) fn bad<T: Ros2Message>(reason: impl Display) -> String {
    format!("{}: {reason}", T::DEFINITION.type_name())
}

fn bad_content<T: Ros2Message>(bytes: usize, error: &cdr_encoding::Error) -> String {
    bad::<T>(format_args!("{error} in a message of {bytes} bytes"))
}

/// Returns a message as little-endian CDR, as `rosbag2` stores it and DDS sends it.
pub fn encode<T: Ros2Message>(message: &T) -> Result<Vec<u8>, String> {
    let mut bytes = LITTLE_ENDIAN.to_vec();
    cdr_encoding::to_writer::<_, LittleEndian, _>(&mut bytes, message)
        .map_err(|error| bad_content::<T>(0, &error))?;
    Ok(bytes)
}

/// Returns the message in these bytes. What follows it is padding. It allocates no more than the
/// bytes hold, whatever lengths they give.
pub fn decode<T: Ros2Message>(bytes: &[u8]) -> Result<T, String> {
    let (head, content) = bytes.split_at(bytes.len().min(LITTLE_ENDIAN.len()));
    let decoded = match head {
        [0, 0, _, _] => cdr_encoding::from_bytes::<T, BigEndian>(content),
        [0, 1, _, _] => cdr_encoding::from_bytes::<T, LittleEndian>(content),
        _ => {
            return Err(bad::<T>(format_args!(
                "{head:02x?} does not begin a message in CDR, expected [00, 00] or [00, 01]"
            )));
        }
    };
    let (message, _) = decoded.map_err(|error| bad_content::<T>(bytes.len(), &error))?;
    Ok(message)
}

pub(crate) trait Field {
    /// The message that it consists of.
    const PART: Option<&'static Definition> = None;
}

macro_rules! plain {
    ($($type:ty),*) => {
        $(impl Field for $type {})*
    };
}
plain!(bool, u8, i8, u16, i32, u32, u64, f32, f64, [f64; 9], String);

impl<T: Field> Field for Vec<T> {
    const PART: Option<&'static Definition> = T::PART;
}

/// Defines the messages of a package: their fields, each with its line in the `.msg` file.
macro_rules! package {
    ($package:ident: $(
        $(#[$of_type:meta])*
        struct $type:ident {
            $($(#[$of_field:meta])* $field:ident: $kind:ty = $line:literal,)*
        }
    )*) => {$(
        $(#[$of_type])*
        #[derive(Clone, Debug, Default, PartialEq, serde::Serialize, serde::Deserialize)]
        pub struct $type {
            $($(#[$of_field])* pub $field: $kind,)*
        }

        impl $crate::Ros2Message for $type {
            const DEFINITION: &'static $crate::Definition = &$crate::Definition {
                package: stringify!($package),
                name: stringify!($type),
                fields: concat!($($line, "\n"),*),
                parts: &[$(<$kind as $crate::definition::Field>::PART),*],
            };
        }

        impl $crate::definition::Field for $type {
            const PART: Option<&'static $crate::Definition> =
                Some(<$type as $crate::Ros2Message>::DEFINITION);
        }
    )*};
}
pub(crate) use package;
