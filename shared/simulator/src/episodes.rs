//! Episodes: what begins once in each so long time, at random, and lasts for a while.

use rand::Rng;
use rand_chacha::ChaCha8Rng;

pub(crate) struct Episodes {
    every_s: f64,
    lasts_s: f64,
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
