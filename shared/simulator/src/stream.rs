//! Which part of a seed's random numbers belongs to what. No two share one, so that nothing random depends on anything else that is.

use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

/// What random numbers are drawn for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Stream {
    /// The sensor's in one scan, by its number.
    Scan(u64),
    /// Streets along a drive.
    Streets,
    /// A drive through a town.
    Drive,
    /// Other road users.
    Traffic,
    /// When the host stalls, by the block of scans in which it does once.
    Stall(u64),
    /// How the vehicle pitches and rolls.
    Nodding,
    /// What turns with the radar.
    Carrier,
}

impl Stream {
    /// Its generator, at its first number.
    pub fn generator(self, seed: u64) -> ChaCha8Rng {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        rng.set_stream(self.number());
        rng
    }

    /// Scans and blocks of them are far fewer than lie between any two.
    fn number(self) -> u64 {
        match self {
            Self::Scan(index) => 1 + index,
            Self::Streets => 1 << 40,
            Self::Drive => 1 << 41,
            Self::Traffic => 1 << 42,
            Self::Stall(block) => (1 << 43) + block,
            Self::Nodding => u64::MAX - 1,
            Self::Carrier => u64::MAX,
        }
    }
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use super::*;

    #[test]
    fn no_two_things_share_a_stream() {
        // 100 000 scans are the most that a configuration may ask for.
        let counted = (0..100_000).flat_map(|i| [Stream::Scan(i), Stream::Stall(i)]);
        let single = [
            Stream::Streets,
            Stream::Drive,
            Stream::Traffic,
            Stream::Nodding,
            Stream::Carrier,
        ];
        let numbers: BTreeSet<u64> = counted.chain(single).map(Stream::number).collect();
        assert_eq!(numbers.len(), 200_005);
    }
}
