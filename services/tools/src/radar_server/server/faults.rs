//! Injected faults of a radar and of its network, the same in each playback.

use clap::Args;

/// The faults to inject while playing.
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

impl Faults {
    /// Returns whether an azimuth is lost.
    pub(super) fn loses(&self, scan: u64, row: usize) -> bool {
        uniform(scan, row as u64) < self.lost
    }

    /// Returns whether a datagram is lost.
    pub(super) fn loses_datagram(&self, number: u64) -> bool {
        uniform(number, 0) < self.lost
    }

    /// Returns whether a datagram is sent twice.
    pub(super) fn doubles(&self, number: u64) -> bool {
        uniform(number, 1) < self.doubled
    }

    /// Returns whether a datagram is sent after the next one.
    pub(super) fn swaps(&self, number: u64) -> bool {
        uniform(number, 2) < self.swapped
    }

    /// Returns whether the connections are reset in a scan.
    pub(super) fn resets(&self, scan: u64) -> bool {
        is_nth(scan, self.reset_every)
    }

    /// Returns whether nothing is sent before a scan.
    pub(super) fn stalls(&self, scan: u64) -> bool {
        is_nth(scan, self.stall_every)
    }

    /// Returns whether there is garbage before an azimuth.
    pub(super) fn garbles(&self, scan: u64, row: usize) -> bool {
        row == 100 && is_nth(scan, self.garbage_every)
    }
}

fn is_nth(scan: u64, every: Option<u64>) -> bool {
    every.is_some_and(|every| (scan + 1).is_multiple_of(every.max(1)))
}

/// Returns a number from 0 to 1 that scan and row determine (SplitMix64).
fn uniform(scan: u64, row: u64) -> f64 {
    let mut z = (scan << 16 | row)
        .wrapping_add(1)
        .wrapping_mul(0x9e37_79b9_7f4a_7c15);
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    ((z ^ (z >> 31)) >> 11) as f64 / (1_u64 << 53) as f64
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn faults_come_in_every_nth_scan_and_in_the_share_that_was_asked_for() {
        let faults = Faults {
            lost: 0.01,
            reset_every: Some(3),
            ..Faults::default()
        };
        let rows = (0..1000).flat_map(|scan| (0..400).map(move |row| (scan, row)));
        let lost = rows.filter(|(scan, row)| faults.loses(*scan, *row)).count();
        assert!((3800..4200).contains(&lost), "{lost}");
        let resets: Vec<_> = (0..9).filter(|scan| faults.resets(*scan)).collect();
        assert_eq!(resets, [2, 5, 8]);
        assert!(!faults.stalls(2) && !faults.garbles(2, 100));
    }
}
