//! Says in the log when the other side goes and comes.

use std::time::Instant;

/// Whether the other side answers, as far as the log knows.
pub(crate) struct Status {
    other: &'static str,
    is_connected: bool,
    since: Instant,
}

impl Status {
    /// Begins without the other side.
    pub fn of(other: &'static str) -> Self {
        Self {
            other,
            is_connected: false,
            since: Instant::now(),
        }
    }

    /// Tells the log of a change. `next`: the first message that has not come.
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
