//! Definitions of messages: names and fields, as ROS 2 writes them.

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
