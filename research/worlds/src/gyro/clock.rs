//! The clock of a gyro: offset, drift, jitter, stalls of its host, and what the host loses.

use rand::Rng;
use rand_chacha::ChaCha8Rng;
use rand_distr::StandardNormal;

use super::config::SimulatedGyroConfig;
use crate::{episodes::Episodes, stream::Stream};

/// Time between two stamps while a host catches up, ns.
const CATCH_UP_NS: i64 = 100_000;

/// Stamps samples in their order.
pub(super) struct Clock<'a> {
    config: &'a SimulatedGyroConfig,
    rng: ChaCha8Rng,
    stalls: Episodes,
    last_ns: i64,
}

impl<'a> Clock<'a> {
    /// The clock of a drive.
    pub fn new(config: &'a SimulatedGyroConfig, seed: u64) -> Self {
        let stalls = Stream::GyroStalls.generator(seed);
        Self {
            config,
            rng: Stream::GyroClock.generator(seed),
            stalls: Episodes::new(config.stall_every_s, config.stall_s, stalls),
            last_ns: i64::MIN + CATCH_UP_NS,
        }
    }

    /// Stamps a sample of a time of the drive, s: ns after the drive's start, or `None` if the host
    /// loses it.
    pub fn stamp_ns(&mut self, time_s: f64) -> Option<i64> {
        let config = self.config;
        let jitter_s = config.jitter_s * self.rng.sample::<f64, _>(StandardNormal);
        let is_lost = self.rng.random::<f64>() < config.lost;
        let stamped_s = self.handled_s(time_s) * (1.0 + config.clock_ppm * 1e-6);
        let stamp_ns = ((stamped_s + config.late_s + jitter_s) * 1e9).round() as i64;
        if is_lost {
            return None;
        }
        self.last_ns = stamp_ns.max(self.last_ns + CATCH_UP_NS);
        Some(self.last_ns)
    }

    /// The time at which the host handles a sample, s: later if it stalls.
    fn handled_s(&mut self, time_s: f64) -> f64 {
        let stall_s = self.stalls.begin_s(time_s);
        stall_s.map_or(time_s, |begin_s| begin_s + self.config.stall_s)
    }
}
