//! The radar's health: a protobuf, which a radar sends every 10 s to who has asked for it.

use std::fmt;

use crate::malformed::Malformed;
use crate::protobuf::{Value, fields};

const MESSAGE: &str = "health";
/// The fields of readings: their numbers and their subjects.
const READINGS: [(u64, &str); 8] = [
    (1, "die temperature"),
    (2, "SoC temperature"),
    (3, "VCO temperature"),
    (4, "ambient temperature"),
    (5, "rotation"),
    (6, "packet rate"),
    (7, "RF health check"),
    (14, "motor current"),
];
const TRANSMITTING_FIELD: u64 = 8;
const ENCODER_ERRORS_FIELD: u64 = 12;
/// The fields of a reading.
const VALUE_FIELD: u64 = 3;
const STATUS_FIELD: u64 = 5;

/// The health that a radar reports: id 40. Other fields are skipped.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Health {
    readings: [Option<Reading>; READINGS.len()],
    /// True if it transmits; `None`: not reported.
    pub transmitting: Option<bool>,
    /// Errors of the encoder; `None`: not reported.
    pub encoder_errors: Option<i32>,
}

/// A value that the radar watches, in a unit that is not documented (temperatures: degrees Celsius,
/// by their limits).
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Reading {
    pub value: f32,
    pub status: HealthStatus,
}

/// The quality of a reading, as the radar judges it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum HealthStatus {
    Unhealthy,
    Warning,
    Healthy,
    #[default]
    Unknown,
}

impl fmt::Display for HealthStatus {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Unhealthy => "unhealthy",
            Self::Warning => "near its limits",
            Self::Healthy => "healthy",
            Self::Unknown => "not judged",
        })
    }
}

impl Health {
    pub fn readings(&self) -> impl Iterator<Item = (&'static str, Reading)> + '_ {
        let named = READINGS.iter().zip(&self.readings);
        named.filter_map(|((_, name), reading)| Some((*name, (*reading)?)))
    }
}

pub(crate) fn decode(payload: &[u8]) -> Result<Health, Malformed> {
    let mut health = Health::default();
    fields(MESSAGE, payload, |number, value| {
        let place = READINGS.iter().position(|(field, _)| *field == number);
        match (place, value) {
            (Some(place), Value::Bytes(bytes)) => health.readings[place] = Some(reading(bytes)?),
            (_, Value::Number(value)) if number == TRANSMITTING_FIELD => {
                health.transmitting = Some(value != 0);
            }
            // Negative numbers have ten bytes, and the lower four count.
            (_, Value::Number(value)) if number == ENCODER_ERRORS_FIELD => {
                health.encoder_errors = Some(value as i32);
            }
            _ => {}
        }
        Ok(())
    })?;
    Ok(health)
}

fn reading(protobuf: &[u8]) -> Result<Reading, Malformed> {
    let mut reading = Reading::default();
    fields(MESSAGE, protobuf, |number, value| {
        match number {
            VALUE_FIELD => reading.value = value.float().unwrap_or(reading.value),
            STATUS_FIELD => {
                reading.status = match value.number() {
                    Some(0) => HealthStatus::Unhealthy,
                    Some(1) => HealthStatus::Warning,
                    Some(2) => HealthStatus::Healthy,
                    _ => HealthStatus::Unknown,
                }
            }
            _ => {}
        }
        Ok(())
    })?;
    Ok(reading)
}
