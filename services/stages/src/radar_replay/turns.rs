//! A recording that is played again and again.

use std::ops::Range;

use gyre_datasets::Dataset;

/// The turns of a part of a recording. Each turn continues in time where the one before ended.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Turns {
    once: Range<usize>,
    /// Duration of a turn, ns: from its first scan to the first one of the next turn.
    turn_ns: i64,
}

impl Turns {
    /// The turns of these scans. Where their times are not known without decoding, a turn lasts a
    /// period for each scan.
    pub fn of(once: Range<usize>, dataset: &dyn Dataset) -> Self {
        let stamp_ns = |scan| dataset.nominal_stamp_ns(scan);
        let ends = || Some(stamp_ns(once.end.checked_sub(1)?)? - stamp_ns(once.start)?);
        let period_ns = dataset.period_ns();
        let turn_ns = match ends() {
            Some(span_ns) if span_ns >= 0 => span_ns + period_ns,
            _ => once.len() as i64 * period_ns,
        };
        Self { once, turn_ns }
    }

    /// Returns the index in the recording of scan `index` of the stream, and the offset to add to
    /// its times, ns.
    pub fn place(&self, index: usize) -> (usize, i64) {
        let (scans, after) = (self.once.len(), index.saturating_sub(self.once.start));
        // Without a turn there is nothing to play; the reader reports it.
        if scans == 0 || after < scans {
            return (index, 0);
        }
        let turn = (after / scans) as i64;
        let shift_ns = self.turn_ns.saturating_mul(turn);
        (self.once.start + after % scans, shift_ns)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn scans_of_later_turns_are_the_same_and_their_times_go_on() {
        let turns = Turns {
            once: 5..8,
            turn_ns: 750,
        };
        let places: Vec<_> = (5..12).map(|index| turns.place(index)).collect();
        assert_eq!(places[..3], [(5, 0), (6, 0), (7, 0)]);
        assert_eq!(places[3..6], [(5, 750), (6, 750), (7, 750)]);
        assert_eq!(places[6], (5, 1500));
    }
}
