//! HOTA (Luiten et al., "HOTA: A higher order metric for evaluating multi-object tracking", 2021):
//! detection and association weigh alike, at all accuracies of the place.

use std::{collections::BTreeMap, fmt};

use gyre_objects::assign;
use serde::Serialize;

use super::{TrackedObject, TrueObject, distance_m, share};

/// The number of similarity thresholds for a pair of objects: twentieths, from 0.05 to 0.95.
const LEVELS: usize = 19;
const LEVEL_STEP: f64 = 0.05;
/// The most that rounding takes from a similarity.
const ROUNDING: f64 = 1e-12;
/// Costs of an assignment for a score of 1: its resolution is a thousandth of a cost.
const SCORE_COSTS: f64 = 1e5;

/// HOTA and its parts, from 0 to 1, each the mean over similarities of 0.05 to 0.95.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Hota {
    /// The mean of the geometric means of detection and association.
    pub hota: f64,
    /// Detection: pairs over pairs, misses and false ones.
    #[serde(rename = "hota_detection")]
    pub detection: f64,
    /// Association: for each pair, the scans that pair its two identities over the scans with at
    /// least one identity.
    #[serde(rename = "hota_association")]
    pub association: f64,
}

impl fmt::Display for Hota {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "{:.3}: detection {:.3}, association {:.3}",
            self.hota, self.detection, self.association
        )
    }
}

#[derive(Clone, Debug, PartialEq)]
pub(super) struct Compared {
    truth: Vec<u64>,
    tracked: Vec<u64>,
    /// For each true and each tracked object: 1 at the same place, 0 at the gate and beyond.
    similarity: Vec<Vec<f64>>,
}

impl Compared {
    pub fn new(truth: &[TrueObject], tracked: &[&TrackedObject], gate_m: f64) -> Self {
        let similar = |truth: &TrueObject, found: &TrackedObject| {
            (1.0 - distance_m(truth, found) / gate_m).max(0.0)
        };
        let row = |truth| tracked.iter().map(|found| similar(truth, found)).collect();
        Self {
            truth: truth.iter().map(|truth| truth.id).collect(),
            tracked: tracked.iter().map(|found| found.id).collect(),
            similarity: truth.iter().map(row).collect(),
        }
    }

    /// Returns each true and each tracked object, by their places in the lists.
    fn all(&self) -> impl Iterator<Item = (usize, usize)> {
        let columns = self.tracked.len();
        (0..self.truth.len()).flat_map(move |row| (0..columns).map(move |column| (row, column)))
    }

    fn identities(&self, row: usize, column: usize) -> (u64, u64) {
        (self.truth[row], self.tracked[column])
    }
}

/// In how many scans identities are there, and how well each two fit over the whole drive.
#[derive(Default)]
struct Identities {
    truth: BTreeMap<u64, f64>,
    tracked: BTreeMap<u64, f64>,
    alike: BTreeMap<(u64, u64), f64>,
}

impl Identities {
    fn of(scans: &[Compared]) -> Self {
        let mut identities = Self::default();
        for scan in scans {
            for id in &scan.truth {
                *identities.truth.entry(*id).or_default() += 1.0;
            }
            for id in &scan.tracked {
                *identities.tracked.entry(*id).or_default() += 1.0;
            }
            let similarity = &scan.similarity;
            for (row, column) in scan.all() {
                let own = similarity[row][column];
                let others: f64 = similarity[row].iter().sum::<f64>()
                    + similarity.iter().map(|row| row[column]).sum::<f64>();
                let both = identities.alike.entry(scan.identities(row, column));
                *both.or_default() += if own > 0.0 { own / (others - own) } else { 0.0 };
            }
        }
        identities
    }

    /// Returns the number of scans with both identities, `shared`, over the number with at least
    /// one.
    fn overlap(&self, (truth, tracked): (u64, u64), shared: f64) -> f64 {
        shared / (self.truth[&truth] + self.tracked[&tracked] - shared)
    }

    /// Returns the pairs of a scan that fit best, over the whole drive and in this scan.
    fn pairs(&self, scan: &Compared) -> Vec<(usize, usize)> {
        let cost = |row: usize, column: usize| {
            let ids = scan.identities(row, column);
            let score = self.overlap(ids, self.alike[&ids]) * scan.similarity[row][column];
            Some(-SCORE_COSTS * score)
        };
        let columns = scan.tracked.len();
        let rows =
            (0..scan.truth.len()).map(|row| (0..columns).map(|column| cost(row, column)).collect());
        let assigned = assign(&rows.collect::<Vec<_>>()).into_iter().enumerate();
        assigned
            .filter_map(|(row, column)| Some((row, column?)))
            .collect()
    }
}

impl Hota {
    pub(super) fn of(scans: &[Compared]) -> Self {
        let identities = Identities::of(scans);
        // For each two identities, the number of scans that pair them at each level.
        let mut matches: BTreeMap<(u64, u64), [usize; LEVELS]> = BTreeMap::new();
        for scan in scans {
            for (row, column) in identities.pairs(scan) {
                let similarity = scan.similarity[row][column] + ROUNDING;
                let reached = (similarity / LEVEL_STEP) as usize;
                let counts = matches.entry(scan.identities(row, column)).or_default();
                let counts = counts.iter_mut().take(reached);
                counts.for_each(|count| *count += 1);
            }
        }
        let both = identities.truth.values().chain(identities.tracked.values());
        let all: f64 = both.sum();
        let mut sum = Self::default();
        for level in 0..LEVELS {
            let counts = || matches.iter().map(|(ids, counts)| (*ids, counts[level]));
            let pairs: usize = counts().map(|(_, count)| count).sum();
            let overlap = |(ids, count)| count as f64 * identities.overlap(ids, count as f64);
            let detection = share(pairs as f64, all as usize - pairs);
            let association = share(counts().map(overlap).sum(), pairs);
            sum.hota += (detection * association).sqrt();
            sum.detection += detection;
            sum.association += association;
        }
        let mean = |sum: f64| sum / LEVELS as f64;
        Self {
            hota: mean(sum.hota),
            detection: mean(sum.detection),
            association: mean(sum.association),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn scan(tracked: u64, similarity: f64) -> Compared {
        Compared {
            truth: vec![1],
            tracked: vec![tracked],
            similarity: vec![vec![similarity]],
        }
    }

    #[test]
    fn perfect_tracking_is_one_and_none_is_zero() {
        let perfect = Hota::of(&vec![scan(7, 1.0); 4]);
        assert!((perfect.hota - 1.0).abs() < 1e-12, "{perfect}");
        let none = Compared {
            truth: vec![1],
            tracked: vec![],
            similarity: vec![vec![]],
        };
        assert_eq!(Hota::of(&vec![none; 4]), Hota::default());
        assert_eq!(Hota::of(&[]), Hota::default());
    }

    #[test]
    fn a_switch_halves_the_association_and_a_distance_the_levels() {
        let switched = Hota::of(&[scan(7, 1.0), scan(7, 1.0), scan(8, 1.0), scan(8, 1.0)]);
        assert_eq!((switched.detection, switched.association), (1.0, 0.5));
        // Similar by 0.5: a pair at the ten levels up to that.
        let apart = Hota::of(&vec![scan(7, 0.5); 4]);
        assert!((apart.hota - 10.0 / 19.0).abs() < 1e-12, "{apart}");
    }

    #[test]
    fn of_two_that_are_near_the_one_that_stays_is_the_pair() {
        let both = Compared {
            truth: vec![1],
            tracked: vec![7, 8],
            similarity: vec![vec![0.8, 0.9]],
        };
        let found = Hota::of(&[scan(7, 1.0), both, scan(7, 1.0), scan(7, 1.0)]);
        // At 0.85 and above identity 7 is no pair in the second scan, and 8 never is.
        let up_to = (4.0 / 5.0f64, 1.0);
        let above = (3.0 / 6.0f64, 3.0 / 5.0);
        let mean = |low: f64, high: f64| (16.0 * low + 3.0 * high) / 19.0;
        let detection = found.detection - mean(up_to.0, above.0);
        let association = found.association - mean(up_to.1, above.1);
        assert!(
            detection.abs() < 1e-12 && association.abs() < 1e-12,
            "{found}"
        );
    }
}
