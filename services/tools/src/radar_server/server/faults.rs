//! Injected faults of a radar and of its network, the same in each playback.

use clap::Args;
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;

#[derive(Clone, Copy, Debug, Default, PartialEq, Args)]
pub struct Faults {
    /// Lose this share of the azimuths, or of the datagrams.
    #[arg(long = "lose", default_value_t = 0.0, value_name = "SHARE")]
    pub lost: f64,
    /// Send this share of the datagrams twice.
    #[arg(
        long = "double",
        default_value_t = 0.0,
        value_name = "SHARE",
        requires = "udp"
    )]
    pub doubled: f64,
    /// Send this share of the datagrams after the next one.
    #[arg(
        long = "swap",
        default_value_t = 0.0,
        value_name = "SHARE",
        requires = "udp"
    )]
    pub swapped: f64,
    /// Reset the connections in the middle of every Nth scan.
    #[arg(long, value_name = "N")]
    pub reset_every: Option<u64>,
    /// Send nothing for --stall-s before every Nth scan.
    #[arg(long, value_name = "N")]
    pub stall_every: Option<u64>,
    /// Length of a stall, s.
    #[arg(long, default_value_t = 4.0, value_name = "S")]
    pub stall_s: f64,
    /// Send bytes that are no message in the middle of every Nth scan.
    #[arg(long, value_name = "N")]
    pub garbage_every: Option<u64>,
}

pub(super) fn is_nth(scan: u64, every: Option<u64>) -> bool {
    every.is_some_and(|every| (scan + 1).is_multiple_of(every.max(1)))
}

/// Returns a number from 0 to 1 that scan and row, or datagram and fault, determine.
pub(super) fn uniform(scan: u64, row: u64) -> f64 {
    ChaCha8Rng::seed_from_u64(scan << 16 | row).random()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn faults_come_in_every_nth_scan() {
        let resets: Vec<_> = (0..9).filter(|scan| is_nth(*scan, Some(3))).collect();
        assert_eq!(resets, [2, 5, 8]);
        assert!(!is_nth(2, None));
    }
}
