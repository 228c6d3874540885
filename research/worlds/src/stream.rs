//! Independent streams of random numbers from one seed, so that no random quantity depends on
//! another.

use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

/// The use of a stream.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Stream {
    /// The sensor in one scan, by its number.
    Scan(u64),
    /// The streets along a drive.
    Streets,
    /// A drive through a town.
    Drive,
    /// The other road users.
    Traffic,
    /// Host stalls, by block of scans with one stall each.
    Stall(u64),
    /// The azimuths of a scan that the host loses, by its number.
    Lost(u64),
    /// Pitch and roll of the vehicle.
    PitchRoll,
    /// The vibration of the mount in one scan, by its number.
    Vibration(u64),
    /// The dirt on the radome.
    Dirt,
    /// The errors of the calibration.
    Miscalibration,
    /// Echoes that are fixed to the radar.
    FixedEchoes,
    /// Bias, scale, misalignment and noise of the gyro.
    GyroErrors,
    /// Jitter and losses of the gyro's clock.
    GyroClock,
    /// Stalls of the gyro's host.
    GyroStalls,
    /// Scale, noise and losses of the wheels.
    WheelErrors,
    /// Slips of the wheels.
    WheelSlips,
    /// Noise, lasting errors and losses of the GNSS receiver.
    GnssErrors,
    /// Reflections that it takes for satellites,
    GnssReflections,
    /// and where these move its fixes.
    GnssDirections,
    /// Holes without a fix.
    GnssHoles,
    /// The lining of a tunnel, by its number.
    Tunnel(u64),
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
            Self::Streets => 1 << 40,
            Self::Drive => 1 << 41,
            Self::Traffic => 1 << 42,
            Self::Stall(block) => (1 << 43) + block,
            Self::Lost(index) => (1 << 44) + index,
            Self::Vibration(index) => (1 << 45) + index,
            Self::Dirt => 1 << 46,
            Self::Miscalibration => 1 << 47,
            Self::GyroErrors => 1 << 48,
            Self::GyroClock => 1 << 49,
            Self::GyroStalls => 1 << 50,
            Self::WheelErrors => 1 << 51,
            Self::WheelSlips => 1 << 52,
            Self::Tunnel(number) => (1 << 53) + number,
            Self::GnssErrors => 1 << 54,
            Self::GnssReflections => 1 << 55,
            Self::GnssDirections => 1 << 56,
            Self::GnssHoles => 1 << 57,
            Self::PitchRoll => u64::MAX - 1,
            Self::FixedEchoes => u64::MAX,
        }
    }
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use super::*;

    #[test]
    fn no_two_uses_share_a_stream() {
        // 100 000 scans are the maximum of the configuration.
        let counted = (0..100_000).flat_map(|i| {
            [
                Stream::Scan(i),
                Stream::Stall(i),
                Stream::Lost(i),
                Stream::Vibration(i),
            ]
        });
        let single = [
            Stream::Streets,
            Stream::Drive,
            Stream::Traffic,
            Stream::Dirt,
            Stream::Miscalibration,
            Stream::PitchRoll,
            Stream::FixedEchoes,
            Stream::GyroErrors,
            Stream::GyroClock,
            Stream::GyroStalls,
            Stream::WheelErrors,
            Stream::WheelSlips,
            Stream::Tunnel(0),
            Stream::GnssErrors,
            Stream::GnssReflections,
            Stream::GnssDirections,
            Stream::GnssHoles,
        ];
        let uses = 4 * 100_000 + single.len();
        let numbers: BTreeSet<u64> = counted.chain(single).map(Stream::number).collect();
        assert_eq!(numbers.len(), uses);
    }
}
