//! Independent streams of random numbers from one seed, so that no random quantity depends on
//! another.

use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

/// The use of a stream.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Stream {
    /// The sensor in one scan, by its number.
    Scan(u64),
    /// The scenery along the streets.
    Scenery,
    /// The other cars.
    Cars,
    /// The lining of the tunnel.
    Tunnel,
    /// Host stalls, by block of scans with one stall each.
    Stall(u64),
    /// The azimuths of a scan that the host loses, by its number.
    Lost(u64),
    /// Bias, scale, misalignment and noise of the gyro.
    GyroErrors,
    /// Losses of the gyro's clock.
    GyroClock,
    /// Stalls of the gyro's host.
    GyroStalls,
    /// Scale, noise and losses of the wheels.
    WheelErrors,
    WheelSlips,
    /// Noise and lasting errors of the GNSS receiver.
    GnssErrors,
    /// Holes without a fix.
    GnssHoles,
}

impl Stream {
    /// The stream's generator, at its first number.
    pub fn generator(self, seed: u64) -> ChaCha8Rng {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        rng.set_stream(self.number());
        rng
    }

    /// There are far fewer scans and blocks than numbers between the constants.
    fn number(self) -> u64 {
        match self {
            Self::Scan(index) => 1 + index,
            Self::Scenery => 1 << 40,
            Self::Cars => 1 << 41,
            Self::Tunnel => 1 << 42,
            Self::Stall(block) => (1 << 43) + block,
            Self::Lost(index) => (1 << 44) + index,
            Self::GyroErrors => 1 << 48,
            Self::GyroClock => 1 << 49,
            Self::GyroStalls => 1 << 50,
            Self::WheelErrors => 1 << 51,
            Self::WheelSlips => 1 << 52,
            Self::GnssErrors => 1 << 54,
            Self::GnssHoles => 1 << 57,
        }
    }
}
