//! Powers of 8 or 16 bits to a row of bytes.

use crate::clock::ByteOrder;
use crate::message::Powers;

/// Pairs of neighbouring bins that decide the order of bytes.
const DECIDING_PAIRS: u64 = 256;

/// The order of the bytes of 16-bit powers. The order is undocumented: it is the order that gives
/// smaller differences between neighbouring bins. In the wrong order the noise of the less
/// significant byte is the more significant one.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct PowerOrder {
    /// Sums of the differences between neighbouring bins in either order, until one is decided.
    little: u64,
    big: u64,
    pairs: u64,
    decided: Option<ByteOrder>,
}

impl PowerOrder {
    pub(super) fn write(&mut self, powers: Powers<'_>, row: &mut [u8]) {
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
