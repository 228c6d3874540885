//! Azimuths that did not arrive, from the encoder counts on both sides.

use super::{Empty, Reading};
use crate::configuration::Configuration;

/// The largest difference of the time between two azimuths from the configured rotation, in turns.
/// Where it differs by more, a turn or more is missing, or the clock was set.
const BREAK_TURNS: f64 = 0.75;

#[derive(Clone, Copy, Debug)]
pub(super) struct Grid {
    pub(super) radar: Configuration,
}

#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Seam {
    /// Number of those before zero.
    trailing: usize,
    /// Number of those after zero.
    leading: usize,
    counts: f64,
    /// Time from row to row, ns.
    ns: f64,
}

impl Grid {
    /// Returns an encoder count less than a full turn. A full turn is 0, as for the readers of
    /// recordings.
    pub(super) fn encoder(&self, count: u16) -> Option<u16> {
        (count <= self.radar.encoder_size).then_some(count % self.radar.encoder_size)
    }

    pub(super) fn is_first(&self, encoder: u16) -> bool {
        f64::from(encoder) < self.radar.step()
    }

    pub(super) fn is_last(&self, last: Reading) -> bool {
        f64::from(last.encoder) + self.radar.step() >= f64::from(self.radar.encoder_size)
    }

    pub(super) fn azimuths_after(&self, last: Reading) -> f64 {
        (f64::from(self.radar.encoder_size) - f64::from(last.encoder)) / self.radar.step()
    }

    pub(super) fn is_break(&self, last: Reading, here: Reading) -> bool {
        let expected_ns = self.counts(last, here) * self.radar.ns_per_count();
        let turn_ns = f64::from(self.radar.encoder_size) * self.radar.ns_per_count();
        (elapsed_ns(last, here) - expected_ns).abs() > BREAK_TURNS * turn_ns
    }

    pub(super) fn gap(&self, last: Reading, here: Reading) -> Empty {
        let counts = self.counts(last, here);
        let rows = (counts / self.radar.step()).round().max(1.0);
        Empty {
            count: rows as usize - 1,
            from: (last.encoder.into(), last.stamp_ns),
            counts: counts / rows,
            ns: elapsed_ns(last, here) / rows,
        }
    }

    pub(super) fn seam(&self, last: Reading, here: Reading) -> Seam {
        let to_zero = f64::from(self.radar.encoder_size - last.encoder);
        // Positions before zero, which zero itself is not.
        let before_zero = (to_zero / self.radar.step()).ceil() as usize - 1;
        // The step across zero may be shorter than the others.
        let counts = self.radar.step();
        if self.is_break(last, here) {
            // Nothing is known of the time in between: both sweeps are continued at the radar's
            // rotation.
            return Seam {
                trailing: before_zero,
                leading: (f64::from(here.encoder) / self.radar.step()) as usize,
                counts,
                ns: self.radar.step() * self.radar.ns_per_count(),
            };
        }
        let Empty { count, ns, .. } = self.gap(last, here);
        let trailing = before_zero.min(count);
        Seam {
            trailing,
            leading: count - trailing,
            counts,
            ns,
        }
    }

    fn counts(&self, last: Reading, here: Reading) -> f64 {
        let counts = f64::from(here.encoder) - f64::from(last.encoder);
        match counts < 0.0 {
            true => counts + f64::from(self.radar.encoder_size),
            false => counts,
        }
    }
}

impl Seam {
    /// Returns the rows after `last`.
    pub(super) fn trailing(&self, last: Reading) -> Empty {
        Empty {
            count: self.trailing,
            from: (last.encoder.into(), last.stamp_ns),
            counts: self.counts,
            ns: self.ns,
        }
    }

    /// Returns the rows before `here`, at most `fits`.
    pub(super) fn leading(&self, here: Reading, fits: usize) -> Empty {
        let count = self.leading.min(fits);
        let rows = (count + 1) as f64;
        let before_ns = (rows * self.ns).round() as i64;
        let encoder = f64::from(here.encoder) - rows * self.counts;
        Empty {
            count,
            from: (encoder, here.stamp_ns.saturating_sub(before_ns)),
            counts: self.counts,
            ns: self.ns,
        }
    }
}

fn elapsed_ns(last: Reading, here: Reading) -> f64 {
    here.stamp_ns.saturating_sub(last.stamp_ns) as f64
}
