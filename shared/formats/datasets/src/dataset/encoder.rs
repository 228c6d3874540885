//! The counts per turn of an encoder, from the counts of the azimuths of a turn, and the correction
//! of its disc.

use std::{f32::consts::TAU, ops::RangeInclusive};

use gyre_radar::median;

/// Maximum deviation of the step over the seam from a whole number of steps, steps.
const STEP_TOLERANCE: f64 = 0.25;
/// Azimuths that can be missing at the seam, as a share of those that are there.
const MISSING_SHARE: f64 = 0.05;
const MIN_AZIMUTHS: usize = 8;
/// Times that the azimuths of a turn take, turns. A sector that is blanked over the encoder's zero
/// makes a turn look like one of a smaller encoder, but shorter by as much.
const TURN_SHARES: RangeInclusive<f64> = 0.95..=1.05;
pub const FIRST_TURNS: usize = 8;

/// The encoder counts of the azimuths of a turn, which may begin anywhere, and the time that the
/// turn took.
#[derive(Clone, Debug, PartialEq)]
pub struct EncoderTurn {
    /// The steps of the encoder; `None` for counts that are of no turn.
    step: Option<EncoderStep>,
    /// ns; the time over the encoder's zero counts as any other, since azimuths can be missing
    /// there.
    turn_ns: Option<i64>,
}

impl EncoderTurn {
    pub fn new(counts: &[u16], time_ns: impl Fn(usize) -> Option<i64>) -> Self {
        Self {
            step: EncoderStep::of(counts),
            turn_ns: turn_ns(counts, time_ns),
        }
    }

    pub(crate) fn turn_ns(&self) -> Option<i64> {
        self.turn_ns
    }

    fn is_turn(&self, turn_ns: Option<i64>) -> bool {
        let times = self.turn_ns.zip(turn_ns);
        let share = times.map(|(ns, turn_ns)| ns as f64 / turn_ns as f64);
        share.is_none_or(|share| TURN_SHARES.contains(&share))
    }
}

fn turn_ns(counts: &[u16], time_ns: impl Fn(usize) -> Option<i64>) -> Option<i64> {
    let rows = counts.len();
    let duration = |from: usize, to: usize| time_ns(to)?.checked_sub(time_ns(from)?);
    let zero = (1..rows).find(|row| counts[*row] < counts[row - 1]);
    let (over_zero_ns, steps) = match zero {
        Some(row) => (duration(row - 1, row)?, rows - 2),
        None => (0, rows.checked_sub(1)?),
    };
    let steps_ns = duration(0, rows - 1)?.checked_sub(over_zero_ns)?;
    Some(steps_ns.checked_mul(rows as i64)? / steps.max(1) as i64)
}

#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct EncoderStep {
    azimuths: usize,
    /// Counts from the first azimuth after zero to the last one before it.
    span: u32,
    pub(crate) step: u16,
}

impl EncoderStep {
    /// Returns the step of a turn, which may begin anywhere; `None` for counts that are of no turn.
    pub(crate) fn of(counts: &[u16]) -> Option<Self> {
        let zero = counts.windows(2).position(|w| w[1] < w[0]);
        let zero = zero.map_or(0, |row| row + 1);
        let (before, after) = counts.split_at(zero);
        let turn = || after.iter().chain(before);
        let steps = turn().zip(turn().skip(1));
        let steps: Option<Vec<u16>> = steps.map(|(a, b)| b.checked_sub(*a)).collect();
        let steps = steps.filter(|steps| steps.len() + 1 >= MIN_AZIMUTHS)?;
        let step = median(steps.iter().map(|step| f64::from(*step)))? as u16;
        (step > 0 && !steps.contains(&0)).then(|| Self {
            azimuths: counts.len(),
            span: steps.iter().map(|step| u32::from(*step)).sum(),
            step,
        })
    }

    pub(crate) fn size(self) -> Option<u16> {
        u16::try_from(self.span + u32::from(self.step)).ok()
    }

    pub(crate) fn seam(self, counts: u16) -> Option<u32> {
        u32::from(counts).checked_sub(self.span)
    }

    /// Returns whether with `counts` per turn the step over the seam is as the others, or some
    /// azimuths are missing there.
    pub(crate) fn fits(self, counts: u16) -> bool {
        let Some(seam) = self.seam(counts) else {
            return false;
        };
        let steps = f64::from(seam) / f64::from(self.step);
        let missing = steps.round() - 1.0;
        let can_be_missing = (MISSING_SHARE * self.azimuths as f64).max(1.0);
        (steps - steps.round()).abs() <= STEP_TOLERANCE && (0.0..=can_be_missing).contains(&missing)
    }
}

/// Returns the counts per turn of the encoder of some turns: `usual` where that fits one of them,
/// otherwise the number that makes the step over the seam as the others, of those that took
/// `turn_ns` if that is known. `None` if they do not show it.
pub fn encoder_counts(turns: &[EncoderTurn], turn_ns: Option<i64>, usual: u16) -> Option<u16> {
    let fits = |turn: &EncoderTurn| turn.step.is_some_and(|step| step.fits(usual));
    if turns.iter().any(fits) {
        return Some(usual);
    }
    let whole = turns.iter().filter(|turn| turn.is_turn(turn_ns));
    // A turn that lacks azimuths at its seam shows too few.
    whole.filter_map(|turn| turn.step?.size()).max()
}

/// Corrects azimuths by the first harmonic of the encoder error:
/// `azimuth + eccentricity * cos(azimuth)`.
///
/// A disc that is 0.1 mm off its axis, at a radius of 40 mm, causes an error of 2.5 mrad, with
/// opposite signs ahead and behind. The scene then appears to rotate while the vehicle moves, and
/// the odometry drifts in yaw: per metre by about that angle over the distance to the scene. The
/// sine term compresses the scan laterally and causes no drift.
pub fn correct_eccentricity(azimuth_rad: &mut [f32], eccentricity_rad: f32) {
    if eccentricity_rad == 0.0 {
        return;
    }
    for azimuth in azimuth_rad {
        let corrected = (*azimuth + eccentricity_rad * azimuth.cos()).rem_euclid(TAU);
        // Rounding can give exactly one turn for a small negative angle.
        *azimuth = if corrected < TAU { corrected } else { 0.0 };
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn counts_that_are_no_turn_show_no_size() {
        let back_and_forth = [9, 3].repeat(5);
        for counts in [&[][..], &[5, 19, 33], &[7; 400], &back_and_forth] {
            let turn = EncoderTurn::new(counts, |_| None);
            assert_eq!(encoder_counts(&[turn], None, 5600), None, "{counts:?}");
        }
    }

    #[test]
    fn ahead_and_behind_shift_in_opposite_directions_and_stay_within_a_turn() {
        let mut azimuths = [0.0, 0.25 * TAU, 0.5 * TAU, 0.75 * TAU];
        correct_eccentricity(&mut azimuths, -0.01);
        let expected = [TAU - 0.01, 0.25 * TAU, 0.5 * TAU + 0.01, 0.75 * TAU];
        assert!(
            azimuths
                .iter()
                .zip(expected)
                .all(|(a, e)| (a - e).abs() < 1e-6),
            "{azimuths:?}"
        );
        let mut tiny = [f32::MIN_POSITIVE];
        correct_eccentricity(&mut tiny, -1e-9);
        assert!((0.0..TAU).contains(&tiny[0]), "{tiny:?}");
    }
}
