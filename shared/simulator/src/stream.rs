//! Independent streams of random numbers from one seed, so that no random quantity depends on
//! another.

use rand::SeedableRng;
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

    /// Host stalls, by block of scans with one stall each.
    pub fn stall(block: u64) -> Self {
        Self((1 << 43) + block)
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
