//! The difference of two looks at one unchanged place.

use super::survey::{Pair, Part, Survey};

/// Steps of the root of a share: weak ones are distinguished better than strong ones.
const STEPS: usize = 8;
/// Looks from nearby of each half of a drive at a place by which the noise is learnt.
const MIN_LOOKED: f64 = 2.0;
/// Share of the unchanged places that may look like anything: no place speaks for a change more
/// than two hundred to one.
const ANYTHING: f64 = 1.0 / 200.0;
/// The share of changed places before the drives are looked at, and the rounds in which it is
/// estimated: it no longer moves by then.
const FIRST_SHARE: f64 = 0.01;
const ROUNDS: usize = 50;
/// The least share that is estimated, so that its logarithm is finite.
const MIN_SHARE: f64 = 1e-6;

/// The shares of returned power that two looks at one place have together.
pub(super) struct Noise {
    /// The logarithm of how much more often the second share comes with the first one at places
    /// that have nothing to do with each other than at one unchanged place.
    log_ratio: [[f64; STEPS]; STEPS],
}

impl Noise {
    /// Learns from the two halves of each drive, which saw the same places unchanged.
    pub fn learn(surveys: [&Survey; 2]) -> Self {
        let mut together = [[0.0f64; STEPS]; STEPS];
        for survey in surveys {
            for (one, other) in [(0, 1), (1, 0)] {
                let other = (survey, Part::Half(other));
                for pair in survey.pairs(Part::Half(one), other, MIN_LOOKED) {
                    together[step(pair.own)][step(pair.other)] += 1.0;
                }
            }
        }
        let sum = |row: &[f64; STEPS]| row.iter().sum::<f64>().max(1.0);
        let total: f64 = together.iter().map(sum).sum();
        let mut log_ratio = [[0.0; STEPS]; STEPS];
        for (row, ratios) in together.iter().zip(&mut log_ratio) {
            for (other, ratio) in ratios.iter_mut().enumerate() {
                let apart = together.iter().map(|row| row[other]).sum::<f64>() / total;
                let same = (1.0 - ANYTHING) * row[other] / sum(row) + ANYTHING * apart;
                // What was never seen says nothing.
                *ratio = if same > 0.0 { (apart / same).ln() } else { 0.0 };
            }
        }
        Self { log_ratio }
    }

    /// Returns the logarithm of how much more likely a place has changed for these shares.
    pub fn log_odds(&self, pair: &Pair) -> f64 {
        self.log_ratio[step(pair.own)][step(pair.other)]
    }

    /// Returns the share of the places that have changed by which they are most likely.
    pub fn changed_share<'a>(&self, pairs: impl Iterator<Item = &'a Pair>) -> f64 {
        let mut counts = [[0.0f64; STEPS]; STEPS];
        pairs.for_each(|pair| counts[step(pair.own)][step(pair.other)] += 1.0);
        let total = counts.iter().flatten().sum::<f64>().max(1.0);
        let changed = |share: f64| {
            let cells = counts.iter().flatten().zip(self.log_ratio.iter().flatten());
            cells.fold(0.0, |sum, (count, log_ratio)| {
                let odds = share / (1.0 - share) * log_ratio.exp();
                sum + count * odds / (1.0 + odds)
            })
        };
        let share = (0..ROUNDS).fold(FIRST_SHARE, |share, _| changed(share) / total);
        share.clamp(MIN_SHARE, 1.0 - MIN_SHARE)
    }
}

/// The step of a share.
fn step(share: f64) -> usize {
    ((share.max(0.0).sqrt() * STEPS as f64) as usize).min(STEPS - 1)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn pairs([own, other]: [f64; 2], count: usize) -> Vec<Pair> {
        let cell = [0; 2];
        let pair = Pair { cell, own, other };
        vec![pair; count]
    }

    /// Looks at places that are free or taken, of which one in a hundred differs.
    fn noise() -> Noise {
        let mut noise = Noise {
            log_ratio: [[0.0; STEPS]; STEPS],
        };
        let last = STEPS - 1;
        let apart = |one: f64, other: f64, together: f64| (one * other / together).ln();
        noise.log_ratio[0][0] = apart(0.9, 0.9, 0.899);
        noise.log_ratio[last][last] = apart(0.1, 0.1, 0.099);
        noise.log_ratio[0][last] = apart(0.9, 0.1, 0.001);
        noise.log_ratio[last][0] = noise.log_ratio[0][last];
        noise
    }

    #[test]
    fn the_share_of_changed_places_is_that_by_which_the_drives_are_most_likely() {
        let noise = noise();
        let same = [pairs([0.0, 0.0], 8990), pairs([1.0, 1.0], 990)].concat();
        let share = |differing: usize| {
            let all = [same.clone(), pairs([0.0, 1.0], differing)].concat();
            noise.changed_share(all.iter())
        };
        // As many as two looks at unchanged places.
        assert!(share(20) < 0.005, "{}", share(20));
        // 420 differ, of which noise has 20. Two places in ten differ if all are drawn anew.
        let expected = 400.0 / 10_400.0 / 0.18;
        assert!((share(420) / expected - 1.0).abs() < 0.1, "{}", share(420));
    }

    #[test]
    fn what_was_never_seen_says_nothing() {
        let survey = || Survey::new(&crate::MapOptions::default());
        let (Ok(one), Ok(other)) = (survey(), survey()) else {
            panic!("the default options are within their bounds");
        };
        let noise = Noise::learn([&one, &other]);
        assert_eq!(noise.log_odds(&pairs([0.0, 1.0], 1)[0]), 0.0);
        assert_eq!(noise.changed_share([].iter()), MIN_SHARE);
    }
}
