//! What a radar says of its health, in the log: once when it changes.

use gyre_colossus::{Health, HealthStatus};

/// What is wrong with a radar.
#[derive(Clone, Debug, Default)]
pub struct Ills {
    /// The names of the readings that are not well.
    of: Vec<&'static str>,
    is_silent: bool,
}

impl Ills {
    /// Logs what has become worse or better.
    pub fn note(&mut self, health: &Health) {
        for (name, reading) in health.readings() {
            let is_ill = matches!(
                reading.status,
                HealthStatus::Unhealthy | HealthStatus::Warning
            );
            let place = self.of.iter().position(|ill| *ill == name);
            let (value, status) = (reading.value, reading.status);
            match (is_ill, place) {
                (true, None) => {
                    tracing::warn!("the radar says that its {name}, {value}, is {status}");
                    self.of.push(name);
                }
                (false, Some(place)) => {
                    tracing::info!("the radar says that its {name}, {value}, is {status} again");
                    self.of.swap_remove(place);
                }
                _ => {}
            }
        }
        let is_silent = health.transmitting == Some(false);
        if is_silent && !self.is_silent {
            tracing::warn!("the radar says that it does not transmit: its scans have no echoes");
        }
        self.is_silent = is_silent;
    }
}
