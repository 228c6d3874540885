//! The radar's health in the log: each change is logged once.

use gyre_colossus::{Health, HealthStatus};

#[derive(Clone, Debug, Default)]
pub struct HealthLog {
    unhealthy: Vec<&'static str>,
    is_silent: bool,
}

impl HealthLog {
    /// Logs the readings that have become worse or better.
    pub fn update(&mut self, health: &Health) {
        for (name, reading) in health.readings() {
            let (value, status) = (reading.value, reading.status);
            let is_unhealthy = matches!(status, HealthStatus::Unhealthy | HealthStatus::Warning);
            let logged = self.unhealthy.iter().position(|it| *it == name);
            match (is_unhealthy, logged) {
                (true, None) => {
                    tracing::warn!("the radar says that its {name}, {value}, is {status}");
                    self.unhealthy.push(name);
                }
                (false, Some(index)) => {
                    tracing::info!("the radar says that its {name}, {value}, is {status} again");
                    self.unhealthy.swap_remove(index);
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
