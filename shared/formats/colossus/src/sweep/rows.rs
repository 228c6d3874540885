//! The rows of a scan.

use gyre_geometry::{ScanLimits, ScanSlot, scan::flag};

use super::Counters;
use crate::{clock::ByteOrder, configuration::Configuration, message::Powers};

/// Pairs of neighbouring bins that decide the order of bytes.
const DECIDING_PAIRS: u64 = 256;

#[derive(Clone, Copy, Debug)]
pub(super) struct Empty {
    pub(super) count: usize,
    /// Encoder count and time of the row before the first.
    pub(super) from: (f64, i64),
    pub(super) counts: f64,
    /// Time from row to row, ns.
    pub(super) ns: f64,
}

#[derive(Clone, Debug)]
pub(super) struct RowWriter {
    pub(super) limits: ScanLimits,
    pub(super) bins: usize,
    encoder_size: f64,
    pub(super) written: usize,
    pub(super) missing: usize,
    order: PowerOrder,
}

impl RowWriter {
    pub(super) fn new(configuration: &Configuration) -> Self {
        let bins = usize::from(configuration.range_in_bins);
        let azimuths = usize::from(configuration.azimuth_samples);
        Self {
            limits: ScanLimits {
                bytes: azimuths * bins,
                azimuths,
            },
            bins,
            encoder_size: f64::from(configuration.encoder_size),
            written: 0,
            missing: 0,
            order: PowerOrder::default(),
        }
    }

    pub(super) fn left(&self) -> usize {
        self.limits.azimuths - self.written
    }

    pub(super) fn clear(&mut self) {
        (self.written, self.missing) = (0, 0);
    }

    pub(super) fn assert_fits(&self, slot: &ScanSlot<'_>) {
        let (azimuths, stamps) = (slot.azimuth_rad.len(), slot.stamp_ns.len());
        let azimuths = azimuths.min(stamps).min(slot.flags.len());
        let fits = slot.bytes.len() >= self.limits.bytes && azimuths >= self.limits.azimuths;
        assert!(fits, "the slot is smaller than the limits");
    }

    pub(super) fn write_measured(
        &mut self,
        place: (f64, i64),
        powers: Powers<'_>,
        slot: &mut ScanSlot<'_>,
        counters: &mut Counters,
    ) {
        let Some(row) = self.next_row(place, flag::MEASURED, slot) else {
            return;
        };
        let bins = powers.bins();
        counters.cut_rows += u64::from(bins > row.len());
        let measured = bins.min(row.len());
        self.order.write(powers, &mut row[..measured]);
        row[measured..].fill(0);
    }

    /// Writes rows that were not measured, at most `fits`.
    pub(super) fn write_empty(&mut self, empty: Empty, fits: usize, slot: &mut ScanSlot<'_>) {
        let (encoder, stamp_ns) = empty.from;
        for k in 1..=empty.count.min(fits) {
            let after_ns = (k as f64 * empty.ns).round() as i64;
            let place = (
                // Rounding must not lead before the start of the turn, or to its end.
                (encoder + k as f64 * empty.counts).clamp(0.0, self.encoder_size - 0.5),
                stamp_ns.saturating_add(after_ns),
            );
            if let Some(row) = self.next_row(place, 0, slot) {
                row.fill(0);
                self.missing += 1;
            }
        }
    }

    /// Returns the bytes of the next row, whose angle, time and flags are written; `None` if the
    /// scan is full.
    fn next_row<'a>(
        &mut self,
        (encoder, stamp_ns): (f64, i64),
        flags: u8,
        slot: &'a mut ScanSlot<'_>,
    ) -> Option<&'a mut [u8]> {
        if self.left() == 0 {
            return None;
        }
        let row = self.written;
        self.written += 1;
        // In f64 and in this order, as the readers of recordings do.
        let step = std::f64::consts::TAU / self.encoder_size;
        slot.azimuth_rad[row] = (encoder * step) as f32;
        slot.stamp_ns[row] = stamp_ns;
        slot.flags[row] = flags;
        slot.bytes.get_mut(row * self.bins..(row + 1) * self.bins)
    }
}

/// The order of the bytes of 16-bit powers. The order is undocumented: it is the order that gives
/// smaller differences between neighbouring bins. In the wrong order the noise of the less
/// significant byte is the more significant one.
#[derive(Clone, Copy, Debug, Default)]
struct PowerOrder {
    /// Sums of the differences between neighbouring bins in either order, until one is decided.
    little: u64,
    big: u64,
    pairs: u64,
    decided: Option<ByteOrder>,
}

impl PowerOrder {
    fn write(&mut self, powers: Powers<'_>, row: &mut [u8]) {
        match powers {
            Powers::Eight(bytes) => row.iter_mut().zip(bytes).for_each(|(to, from)| *to = *from),
            Powers::Sixteen(bytes) => {
                let (pairs, _) = bytes.as_chunks::<2>();
                let significant = match self.order(pairs) {
                    ByteOrder::Little => 1,
                    ByteOrder::Big => 0,
                };
                for (to, pair) in row.iter_mut().zip(pairs) {
                    *to = pair[significant];
                }
            }
        }
    }

    /// Returns the order; big-endian, like the headers, until the powers determine it.
    fn order(&mut self, powers: &[[u8; 2]]) -> ByteOrder {
        if let Some(order) = self.decided {
            return order;
        }
        let difference = |number: fn([u8; 2]) -> u16| -> u64 {
            let of_pair = |pair: &[[u8; 2]]| u64::from(number(pair[0]).abs_diff(number(pair[1])));
            powers.windows(2).map(of_pair).sum()
        };
        self.little += difference(u16::from_le_bytes);
        self.big += difference(u16::from_be_bytes);
        self.pairs += powers.len().saturating_sub(1) as u64;
        let order = match self.little < self.big {
            true => ByteOrder::Little,
            false => ByteOrder::Big,
        };
        if self.pairs >= DECIDING_PAIRS && self.little != self.big {
            self.decided = Some(order);
        }
        order
    }
}
