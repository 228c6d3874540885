//! Independent streams of random numbers from one seed, so that no random quantity depends on
//! another.

use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// The use of a stream. There are far fewer scans and blocks than numbers between the constants.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Stream(u64);

impl Stream {
    pub const SCENERY: Self = Self(1 << 40);
    pub const CARS: Self = Self(1 << 41);
    pub const TUNNEL: Self = Self(1 << 42);
    pub const GYRO_ERRORS: Self = Self(1 << 48);
    pub const GYRO_CLOCK: Self = Self(1 << 49);
    pub const GYRO_STALLS: Self = Self(1 << 50);
    pub const WHEEL_ERRORS: Self = Self(1 << 51);
    pub const WHEEL_SLIPS: Self = Self(1 << 52);
    pub const GNSS_ERRORS: Self = Self(1 << 54);
    pub const GNSS_HOLES: Self = Self(1 << 57);

    /// The sensor in one scan, by its number.
    pub fn scan(index: u64) -> Self {
        Self(1 + index)
    }

    /// The azimuths of a scan that the host loses, by its number.
    pub fn lost(index: u64) -> Self {
        Self((1 << 44) + index)
    }

    pub fn generator(self, seed: u64) -> ChaCha8Rng {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        rng.set_stream(self.0);
        rng
    }
}

/// Episodes: what begins once in each so long time, at random, and lasts for a while.
pub struct Episodes {
    every_s: f64,
    pub(crate) lasts_s: f64,
    rng: ChaCha8Rng,
    /// Number of those that were drawn, and the begin of the last one, s.
    drawn: i64,
    begin_s: f64,
}

impl Episodes {
    /// Episodes of a duration, s, one in each so long time, s; none if either is 0.
    pub fn new(every_s: f64, lasts_s: f64, rng: ChaCha8Rng) -> Self {
        Self {
            every_s,
            lasts_s,
            rng,
            drawn: 0,
            begin_s: f64::NEG_INFINITY,
        }
    }

    /// Returns when the episode began that a time of the drive lies in, s. Times ascend.
    pub fn begin_s(&mut self, time_s: f64) -> Option<f64> {
        if self.every_s <= 0.0 || self.lasts_s <= 0.0 {
            return None;
        }
        while self.drawn as f64 * self.every_s <= time_s {
            let begins = self.rng.random::<f64>() * (self.every_s - self.lasts_s);
            self.begin_s = self.drawn as f64 * self.every_s + begins;
            self.drawn += 1;
        }
        let lasts = self.begin_s..self.begin_s + self.lasts_s;
        lasts.contains(&time_s).then_some(self.begin_s)
    }
}
