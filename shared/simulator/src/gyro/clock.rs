//! The clock of a gyro: its offset, the stalls of its host, and lost samples.

use rand::Rng;
use rand_chacha::ChaCha8Rng;

use super::SimulatedGyroConfig;
use crate::{episodes::Episodes, stream::Stream};

/// Time between two stamps while a host catches up, ns.
const CATCH_UP_NS: i64 = 100_000;
/// Time between stalls and their duration, s. Samples of a stall are stamped at its end.
const STALL_EVERY_S: f64 = 2.0;
const STALL_S: f64 = 0.06;
const LOST: f64 = 0.02;

pub(super) struct Clock<'a> {
    config: &'a SimulatedGyroConfig,
    rng: ChaCha8Rng,
    stalls: Episodes,
    last_ns: i64,
}

impl<'a> Clock<'a> {
    pub fn new(config: &'a SimulatedGyroConfig, seed: u64) -> Self {
        let stalls = Stream::GYRO_STALLS.generator(seed);
        Self {
            config,
            rng: Stream::GYRO_CLOCK.generator(seed),
            stalls: Episodes::new(STALL_EVERY_S, STALL_S, stalls),
            last_ns: i64::MIN + CATCH_UP_NS,
        }
    }

    /// Stamps a sample of a time of the drive, s: ns after the drive's start, or `None` if the host
    /// loses it.
    pub fn stamp_ns(&mut self, time_s: f64) -> Option<i64> {
        let is_lost = self.rng.random::<f64>() < LOST && self.config.faults;
        let stall_s = self.stalls.begin_s(time_s);
        let stall_s = stall_s.filter(|_| self.config.faults);
        let handled_s = stall_s.map_or(time_s, |begin_s| begin_s + STALL_S);
        let stamp_ns = ((handled_s + self.config.delay_s) * 1e9).round() as i64;
        if is_lost {
            return None;
        }
        self.last_ns = stamp_ns.max(self.last_ns + CATCH_UP_NS);
        Some(self.last_ns)
    }
}
