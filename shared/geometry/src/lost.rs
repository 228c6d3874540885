//! Where the host of a radar lost azimuths of a turn.

use std::f32::consts::TAU;

/// The largest number of gaps in a turn: places where azimuths were lost together.
pub const MAX_GAPS: usize = 8;
/// The largest number of lost azimuths that are placed one by one. More are lost in bursts.
pub const MAX_SINGLE: usize = 7;

/// Where azimuths of a turn were lost: gaps in order, each before one of the rows between two,
/// which are equally likely.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct LostAzimuths {
    gaps: [[u16; 3]; MAX_GAPS],
}

impl LostAzimuths {
    /// Creates it from gaps: the first and the last row before which azimuths may have been lost,
    /// and their number. A number of 0 ends the gaps; of more than [`MAX_GAPS`] the first are
    /// taken.
    pub fn of_gaps(gaps: impl IntoIterator<Item = [u16; 3]>) -> Self {
        let mut lost = Self::default();
        let gaps = gaps.into_iter().take_while(|[.., azimuths]| *azimuths > 0);
        lost.gaps
            .iter_mut()
            .zip(gaps)
            .for_each(|(to, gap)| *to = gap);
        lost
    }

    pub fn between(rows: impl IntoIterator<Item = [u16; 2]>) -> Self {
        Self::of_gaps(rows.into_iter().map(|[first, last]| [first, last, 1]))
    }

    /// Returns azimuths that may have been lost anywhere in a turn of `azimuths`: few of them one
    /// by one, more of them together.
    pub fn anywhere(count: usize, azimuths: usize) -> Self {
        let last = azimuths.saturating_sub(count) as u16;
        match count {
            0..=MAX_SINGLE => Self::between((0..count).map(|_| [0, last])),
            _ => Self::of_gaps([[0, last, count as u16]]),
        }
    }

    pub fn count(&self) -> usize {
        self.gaps.iter().map(|gap| usize::from(gap[2])).sum()
    }

    /// Returns, in order, the first and the last row before which azimuths may have been lost, and
    /// their number.
    pub fn gaps(&self) -> &[[u16; 3]] {
        let count = self.gaps.iter().take_while(|gap| gap[2] > 0).count();
        &self.gaps[..count]
    }

    /// Returns the number of azimuths in gaps of several whose place is unknown: it may be before
    /// more rows than the gap has azimuths.
    pub fn unplaced(&self) -> usize {
        let is_unknown = |gap: &&[u16; 3]| gap[2] > 1 && gap[1] - gap[0] > gap[2];
        let unknown = self.gaps().iter().filter(is_unknown);
        unknown.map(|gap| usize::from(gap[2])).sum()
    }

    /// Returns the variance of the mean of the rows' azimuths due to unknown places, rad², in a
    /// turn of `azimuths`.
    pub fn variance_of_mean_rad2(&self, azimuths: usize) -> f32 {
        let measured = azimuths.saturating_sub(self.count()).max(1) as f32;
        // The mean falls back by the gap for each row behind the place: its variance is the
        // variance of one of n places, (n² - 1) / 12.
        let of_gaps = self.gaps().iter().map(|[first, last, azimuths]| {
            let places = f32::from(last - first) + 1.0;
            f32::from(*azimuths).powi(2) * (places * places - 1.0) / 12.0
        });
        let step_rad = TAU / azimuths.max(1) as f32;
        of_gaps.sum::<f32>() * (step_rad / measured).powi(2)
    }

    /// Returns the expected azimuth of a row, in steps of the turn.
    #[inline]
    pub fn azimuth_of(&self, row: f32) -> f32 {
        let lost = self.gaps().iter().map(|gap| {
            let [first, last, azimuths] = gap.map(f32::from);
            azimuths * ((row - first + 1.0) / (last - first + 1.0)).clamp(0.0, 1.0)
        });
        row + lost.sum::<f32>()
    }
}
