//! Logs when the other side is lost and found.

use std::time::Instant;

pub(crate) struct ConnectionLog {
    other: &'static str,
    is_connected: bool,
    since: Instant,
}

impl ConnectionLog {
    pub fn of(other: &'static str) -> Self {
        Self {
            other,
            is_connected: false,
            since: Instant::now(),
        }
    }

    /// Logs a change. `next` is the first message that has not arrived.
    pub fn update(&mut self, is_connected: bool, next: u64) {
        if self.is_connected == is_connected {
            return;
        }
        let (other, seconds) = (self.other, self.since.elapsed().as_secs_f64());
        match is_connected {
            true => {
                tracing::info!("the {other} is there after {seconds:.1} s: going on at item {next}")
            }
            false => tracing::warn!("the {other} is out of reach: waiting for item {next}"),
        }
        (self.is_connected, self.since) = (is_connected, Instant::now());
    }
}
