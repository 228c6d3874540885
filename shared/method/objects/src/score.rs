//! The score of a track: the logarithm of the likelihood of an object over that of clutter
//! (Sittler; Blackman and Popoli, "Design and Analysis of Modern Tracking Systems", 1999,
//! Sec. 6.2).
//!
//! The terms are those of a logistic regression over the tracks in their third to eighth scans, on
//! the simulated drives on which [docs/objects.md](../../../../docs/objects.md) says that it was
//! built. It is over the sums of a track, not over single clusters: clutter comes back from scan to
//! scan at the same places, so that a scan counts less than it would by itself, but it does not
//! move as predicted.

use nalgebra::{Point2, Vector2};

use crate::returns::Return;

/// The least and the largest evidence of a cluster.
const BOUNDS: [f64; 2] = [-4.0, 2.0];
/// The evidence of a cluster of full weight, at a new place, with nothing around it, that is where
/// it was predicted.
const BASE: f64 = 1.8;
/// The growth with the logarithm of the mean weight of the returns: vehicles have strong edges,
/// hedges have none.
const STRENGTH: f64 = 1.1;
/// The growth with the range, 1/m: all weights fall with it.
const RANGE: f64 = 0.013;
/// The loss if the place has returned in all scans before.
const BEFORE: f64 = 1.6;
/// The loss with the logarithm of the weight around the cluster over its own: vehicles stand free.
const AROUND: f64 = 0.3;
/// Radius in which that is, m: more than a car is long.
const AROUND_M: f64 = 5.0;
/// The loss with the squared Mahalanobis distance from the prediction, up to 20.
const MISFIT: f64 = 0.2;
const LARGEST_MISFIT: f64 = 20.0;
/// The evidence where all places that the object has left are free, and its loss where all are
/// taken.
const LEFT: [f64; 2] = [1.05, 1.75];

/// Returns the evidence of a cluster.
pub(crate) fn of_cluster(returns: &[Return], members: &[u32], chi_square: f64) -> f64 {
    let own = || members.iter().map(|member| &returns[*member as usize]);
    let count = members.len().max(1) as f64;
    let weight: f64 = own().map(|found| found.weight).sum();
    let before: f64 = own().map(|found| found.weight * found.share).sum();
    let sum = own().fold(Vector2::zeros(), |sum, found| sum + found.at.coords);
    let centre = Point2::from(sum / count);
    let near = |found: &&Return| (found.at - centre).norm() < AROUND_M;
    let all: f64 = returns.iter().filter(near).map(|found| found.weight).sum();
    let inner: f64 = own().filter(near).map(|found| found.weight).sum();
    let around = (all - inner).max(0.0) / weight;
    let range_m = own().map(|found| found.range_m).sum::<f64>() / count;
    let evidence = BASE + STRENGTH * (weight / count).ln() + RANGE * range_m
        - BEFORE * before / weight
        - AROUND * (1.0 + around).ln()
        - MISFIT * chi_square.min(LARGEST_MISFIT);
    evidence.clamp(BOUNDS[0], BOUNDS[1])
}

/// Returns the evidence of the places that the object has left, by the share of them where
/// something is.
pub(crate) fn of_places_left(taken: f64) -> f64 {
    let [free, loss] = LEFT;
    free - loss * taken
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(x: f64, weight: f64, share: f64) -> Return {
        Return {
            at: Point2::new(x, 10.0),
            direction: Vector2::y(),
            range_m: 10.0,
            time_s: 0.0,
            doppler_s: 0.0,
            weight,
            stands_out: true,
            share,
        }
    }

    #[test]
    fn what_is_new_strong_and_free_around_speaks_for_an_object_and_each_fault_against_it() {
        let good = [at(0.0, 0.6, 0.05), at(1.0, 0.6, 0.05)];
        let score = |returns: &[Return], chi_square| of_cluster(returns, &[0, 1], chi_square);
        let best = score(&good, 1.0);
        assert!(best > 0.5, "{best}");
        let weak = good.map(|found| Return {
            weight: 0.1,
            ..found
        });
        let standing = good.map(|found| Return {
            share: 0.9,
            ..found
        });
        let surrounded = [good[0], good[1], at(2.0, 1.0, 0.9), at(-2.0, 1.0, 0.9)];
        for (worse, chi_square) in [
            (&weak[..], 1.0),
            (&standing, 1.0),
            (&surrounded, 1.0),
            (&good, 12.0),
        ] {
            assert!(score(worse, chi_square) < best, "{worse:?}");
        }
        let far = [good[0], good[1], at(9.0, 1.0, 0.9), at(-9.0, 1.0, 0.9)];
        assert_eq!(score(&far, 1.0), best);
        let beyond = good.map(|found| Return {
            range_m: 50.0,
            ..found
        });
        assert!(score(&beyond, 1.0) > best);
    }

    #[test]
    fn free_places_behind_speak_for_an_object_and_taken_ones_against_it() {
        assert!(of_places_left(0.0) > 1.0 && of_places_left(1.0) < -0.5);
    }
}
