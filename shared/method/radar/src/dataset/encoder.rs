//! The counts per turn of an encoder, from the counts of the azimuths of a turn.

use crate::median::median;

/// Maximum deviation of the step over the seam from a whole number of steps, steps.
const STEP_TOLERANCE: f64 = 0.25;
/// Azimuths that can be missing at the seam, as a share of those that are there.
const MISSING_SHARE: f64 = 0.05;
/// Minimum number of azimuths that show the size of an encoder.
const MIN_AZIMUTHS: usize = 8;

/// The step of an encoder from azimuth to azimuth in a turn.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct EncoderStep {
    azimuths: usize,
    /// Counts from the first azimuth after zero to the last one before it.
    span: u32,
    /// Counts from one azimuth to the next.
    pub(crate) step: u16,
}

impl EncoderStep {
    /// Returns the step of a turn, which may begin anywhere; `None` for counts that are of no turn.
    pub(crate) fn of(counts: &[u16]) -> Option<Self> {
        let zero = counts
            .windows(2)
            .position(|w| w[1] < w[0])
            .map_or(0, |row| row + 1);
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

    /// Returns the counts per turn with which the step over the seam is as the others.
    pub(crate) fn size(self) -> Option<u16> {
        u16::try_from(self.span + u32::from(self.step)).ok()
    }

    /// Returns the counts over the seam, for an encoder of `counts` per turn.
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
/// otherwise the number that makes the step over the seam as the others. `None` if they do not show
/// it.
pub fn encoder_counts<'a>(turns: impl IntoIterator<Item = &'a [u16]>, usual: u16) -> Option<u16> {
    let steps = turns.into_iter().filter_map(EncoderStep::of);
    let steps: Vec<EncoderStep> = steps.collect();
    match steps.iter().any(|step| step.fits(usual)) {
        true => Some(usual),
        // A turn that lacks azimuths at its seam shows too few.
        false => steps.iter().filter_map(|step| step.size()).max(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn turn(azimuths: u32, size: u32, first: u32) -> Vec<u16> {
        let count = |k| ((first + k * size / azimuths) % size) as u16;
        (0..azimuths).map(count).collect()
    }

    #[test]
    fn the_size_makes_the_step_over_the_seam_as_the_others() {
        for size in [2_800, 5_595, 5_600, 16_000] {
            for first in [0, 5, size / 3] {
                let counts = turn(400, size, first);
                let found = encoder_counts([&counts[..]], 5600);
                assert_eq!(found, u16::try_from(size).ok(), "{size} from {first}");
            }
        }
    }

    #[test]
    fn azimuths_that_are_missing_at_the_seam_make_no_smaller_encoder() {
        let whole = turn(400, 5_600, 7);
        for missing in 0..20 {
            assert_eq!(encoder_counts([&whole[..400 - missing]], 5600), Some(5600));
        }
        let other = turn(400, 16_000, 20);
        assert_eq!(
            encoder_counts([&other[3..], &other[..], &other[..390]], 5600),
            Some(16_000)
        );
    }

    #[test]
    fn counts_that_are_no_turn_show_no_size() {
        for counts in [
            &[][..],
            &[5, 19, 33],
            &[7; 400],
            &[9, 3, 9, 3, 9, 3, 9, 3, 9],
        ] {
            assert_eq!(encoder_counts([counts], 5600), None, "{counts:?}");
        }
    }
}
