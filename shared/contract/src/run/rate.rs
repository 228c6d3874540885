//! The pace of playing a recording.

use std::{borrow::Cow, fmt, str::FromStr};

use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::{Deserialize, Deserializer, Serialize, Serializer, de};

/// The pace of the source.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Rate {
    /// As fast as the window admits.
    Max,
    /// So many times the sensor's own pace; 1 is real time.
    Factor(f64),
}

impl Rate {
    /// So many times the sensor's own pace, where it has one.
    pub fn factor(self) -> Option<f64> {
        match self {
            Self::Max => None,
            Self::Factor(factor) => Some(factor),
        }
    }
}

impl FromStr for Rate {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        match text {
            "max" => Ok(Self::Max),
            "realtime" => Ok(Self::Factor(1.0)),
            _ => match text.parse() {
                Ok(factor) if (0.001..=1000.0).contains(&factor) => Ok(Self::Factor(factor)),
                _ => Err(format!(
                    "rate is `{text}`, but must be `max`, `realtime` or a factor from 0.001 to 1000"
                )),
            },
        }
    }
}

impl fmt::Display for Rate {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Max => f.write_str("max"),
            Self::Factor(1.0) => f.write_str("realtime"),
            Self::Factor(factor) => write!(f, "{factor}"),
        }
    }
}

impl Serialize for Rate {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_str(self)
    }
}

impl<'de> Deserialize<'de> for Rate {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let text = match toml::Value::deserialize(deserializer)? {
            toml::Value::String(text) => text,
            number => number.to_string(),
        };
        text.parse().map_err(de::Error::custom)
    }
}

impl JsonSchema for Rate {
    fn schema_name() -> Cow<'static, str> {
        "Rate".into()
    }

    fn json_schema(_: &mut SchemaGenerator) -> Schema {
        json_schema!({ "anyOf": [
            { "enum": ["max", "realtime"] },
            { "type": "number", "minimum": 0.001, "maximum": 1000 },
        ] })
    }
}
